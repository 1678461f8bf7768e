"""The tutorial's tracker as one loop in one process, without a network: VIDEO N."""

import sys

import cv2
import numpy as np

from benchmarks.peers.programs.measuring import Ages, paced_frames


def main():
    """Find the largest moving object of each frame."""
    ages = Ages(int(sys.argv[2]))
    background = cv2.createBackgroundSubtractorMOG2(700, 25, True)
    kernel = np.ones((20, 20), np.uint8)
    for frame, stamp_ns in paced_frames(sys.argv[1]):
        mask = cv2.morphologyEx(background.apply(frame), cv2.MORPH_CLOSE, kernel)
        _, mask = cv2.threshold(cv2.medianBlur(mask, 5), 127, 255, cv2.THRESH_BINARY)
        contours, _ = cv2.findContours(mask, cv2.RETR_TREE, cv2.CHAIN_APPROX_SIMPLE)
        if contours:
            cv2.boundingRect(max(contours, key=cv2.contourArea))
        if not ages.note(stamp_ns):
            break


if __name__ == "__main__":
    main()
