"""``zv relay``: a second stream of pictures, slower, smaller, cropped or rectified."""
