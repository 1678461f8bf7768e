"""Runs a program with windows that need no screen: ``python fake_windows.py PROGRAM ARGUMENT...``.

``imshow`` prints what it is given, and the fifth picture gets a q.
"""

import runpy
import sys

import cv2

shown = []
cv2.namedWindow = lambda name: None
cv2.imshow = lambda name, pixels: (
    shown.append(name),
    print(name, *pixels.shape, pixels.dtype, flush=True),
)
cv2.waitKey = lambda ms: ord("q") if len(shown) == 5 else -1
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
