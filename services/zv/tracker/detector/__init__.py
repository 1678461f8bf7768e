"""Finds the objects of a picture by a model that the user has: an ONNX file of a detector.

`model` loads a file and runs it: `onnx_file` reads what it says about itself, `runtimes` runs it by
OpenCV or ONNX Runtime, `layouts` and `decoding` turn its outputs into boxes, `placement` fits a
picture into its input, `suppression` leaves out boxes that are found twice. `worker` runs one model
for several cameras.
"""
