"""Tells whether costs grow faster than the work that causes them."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

LIMIT = 1.1
"""A cost whose exponent is above it grows faster than the work; less may be an error."""

FITTED = 3
"""Points, of the most work. As each has at least twice the work of the one before, an error of 5 %
in one of them changes the exponent by at most 0.04."""


def exponent(works: Sequence[float], costs: Sequence[float]) -> float:
    """Return e of the best fit of cost = c * work ** e over the last three points.

    A process costs something also without work, which hides how its cost grows while there is
    little to do; so points of less work are left out.

    Args:
        works: Ascending, at least two.
        costs: All above 0.
    """
    x, y = ([math.log(each) for each in values[-FITTED:]] for values in (works, costs))
    return statistics.linear_regression(x, y).slope


def grows_faster(works: Sequence[float], costs: Sequence[float]) -> bool:
    """Tell whether a cost grows faster than the work."""
    return exponent(works, costs) > LIMIT
