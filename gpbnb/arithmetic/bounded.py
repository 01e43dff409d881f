"""An error together with its bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any


class BoundedError:
    """The error of one computed result, and its bounds by name; the base class of the trials in each topic.

    Attributes
    ----------
    error : exact.
    bounds : name → bound, exact or float64.
    """

    error: Fraction
    bounds: Mapping[str, Any]

    def ratio(self, bound: str) -> float:
        """Return error / bound: 0 for an exact result, infinity for an error with a bound of zero."""
        if not self.error:
            return 0.0
        return float(self.error / Fraction(self.bounds[bound])) if self.bounds[bound] else math.inf

    def overestimation(self, bound: str) -> float:
        """Return bound / error: infinity for an exact result with a bound above zero, 1 if both are zero."""
        if not self.error:
            return math.inf if self.bounds[bound] else 1.0
        return float(Fraction(self.bounds[bound]) / self.error)

    def violates(self, bound: str) -> bool:
        """Whether the error exceeds the bound, decided exactly."""
        return self.error > Fraction(self.bounds[bound])
