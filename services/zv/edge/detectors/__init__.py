"""Edge detectors: from pictures to thin edge maps and their steps, independent of settings.

``detection.py`` has the interface. Each detector is a frozen dataclass of its parameters in a
module of its own, and ``available.py`` lists them by name. ``thinning.py`` and ``rendering.py``
hold what they share: thin lines, and pictures of the steps.
"""
