"""An exact filter run by weighted least squares, for evaluating the printed equations of the filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.ledger.statements import Statement

STATES, MEASUREMENTS, STEPS = 3, 2, 5


@cache
def least_squares_run() -> dict[str, dict[int, sp.Matrix]]:
    """Return five steps of a random filter, with each matrix by letter and index.

    Estimates, covariances, gains and closed loops come from the weighted least squares of prediction and measurement,
    solved through the information matrix, and not from the filter's equations. All matrices change from step to step.
    """
    rng = np.random.default_rng(98)
    n, m = STATES, MEASUREMENTS

    def numbers(rows: int, columns: int) -> sp.Matrix:
        return sp.Matrix(rows, columns, lambda i, j: sp.Integer(int(rng.integers(-9, 10))))

    def covariance(size: int) -> sp.Matrix:
        half = numbers(size, size)
        return half * half.T + sp.eye(size)

    letters: dict[str, dict[int, sp.Matrix]] = {
        letter: {} for letter in ["Phi", "H", "Q", "R", "z", "x", "P", "prior", "K", "F", "u"]
    }
    letters["x"][0], letters["P"][0] = numbers(n, 1), covariance(n)
    for k in range(1, STEPS + 1):
        Phi, H, Q, R, z = numbers(n, n) / 10, numbers(m, n), covariance(n), covariance(m), numbers(m, 1)
        prior = Phi * letters["P"][k - 1] * Phi.T + Q
        P = (prior.inv() + H.T * R.inv() * H).inv()
        F, K = P * prior.inv() * Phi, P * H.T * R.inv()
        letters["Phi"][k - 1], letters["H"][k], letters["Q"][k - 1], letters["R"][k] = Phi, H, Q, R
        letters["z"][k], letters["prior"][k], letters["P"][k], letters["K"][k] = z, prior, P, K
        letters["F"][k], letters["u"][k] = F, K * z
        letters["x"][k] = F * letters["x"][k - 1] + letters["u"][k]
    return letters


def _by_index(values: Mapping[int, sp.Matrix]) -> Callable[[Any], sp.Matrix]:
    return lambda index: values[int(index)]


def names(k: int) -> dict[str, Any]:
    """Return the values of the letters of section 12 in step k of the run; KeyError for an index outside it."""
    run = least_squares_run()
    found: dict[str, Any] = {letter: _by_index(run[letter]) for letter in ("Phi", "H", "Q", "R", "z", "x", "P", "K")}
    found |= {"phi": found["Phi"], "x_star": found["x"], "F": _by_index(run["F"]), "u": _by_index(run["u"])}
    found |= {"k": sp.Integer(k), "P_kp": run["prior"][k], "I": sp.eye(STATES), "x_0": run["x"][0]}
    return found | {"K_p": 2 * run["K"][k]}  # (101) contains this letter, which no equation defines


def holds_exactly(printed: Statement) -> bool:
    """Whether all printed equations hold in two steps of the run."""
    links = [link for k in (2, 3) for link in printed.links(names(k))]
    return bool(links) and all(link.symbol == "==" and link.left == link.right for link in links)
