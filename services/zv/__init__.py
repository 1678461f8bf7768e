"""One folder per process, and the command line that starts them."""

import os

# OpenCV reads it when it is loaded: an image file of more pixels than any frame may have (8K) is
# refused by its header, before it takes memory.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(7680 * 4320))
