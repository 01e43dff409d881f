"""Compiled update of the state by compensated (Kahan) summation."""

from __future__ import annotations

from typing import Any

from gpbnb.arithmetic.kernels.compiling import borrowing
from gpbnb.arithmetic.kernels.matrices import copy, difference, matrix_sum, product


@borrowing
def compensated_update(fmt: Any, increment: Any, h: Any, K: Any, z: Any, x: Any, carried: Any, work: Any) -> None:
    """Add (Phi - I) x + K (z - H Phi x) to x, and carry the rounding error of the addition to the next step.

    Parameters
    ----------
    increment : Phi - I, rounded.
    carried : rounding error of the estimate, from the previous step and for the next.
    work : the workspace of the step.
    """
    d, u, y, g = work.v, work.u, work.y, work.g
    product(fmt, increment, x, d)
    matrix_sum(fmt, x, d, u)
    product(fmt, h, u, y)
    difference(fmt, z, y, g)
    product(fmt, K, g, u)
    matrix_sum(fmt, d, u, d)
    difference(fmt, d, carried, d)
    matrix_sum(fmt, x, d, u)
    difference(fmt, u, x, carried)
    difference(fmt, carried, d, carried)
    copy(fmt, u, x)
