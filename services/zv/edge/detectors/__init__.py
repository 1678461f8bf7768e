"""Edge detectors: turn pictures into thin edge maps and their steps, independent of settings.

``detection.py`` defines the interface. Each detector is a frozen dataclass of its parameters, and
``available.py`` lists the detectors by name. They share ``thinning.py``, for non-maximum
suppression and hysteresis, and ``rendering.py``, for pictures of the steps.
"""
