"""Edge detectors: turn pictures into thin edge maps and their steps, independent of settings.

``detection.py`` defines the interface. Each detector is a frozen dataclass of its parameters, and
``available.py`` lists the detectors by name. ``rendering.py`` makes the pictures of the steps.
"""
