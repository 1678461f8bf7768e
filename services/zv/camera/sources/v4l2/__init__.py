"""Video4Linux: what a device offers, which of it is chosen, its controls, its buffers.

``driver`` makes the calls. ``offers`` and ``choice`` decide on format, size and rate. ``buffers``
takes the pictures out of the driver, and ``layouts`` knows how each format stores them.
``controls`` reads and sets exposure, gain and the like. ``listing`` finds the devices of this
machine.
"""
