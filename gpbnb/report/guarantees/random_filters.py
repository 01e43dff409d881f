"""Random Kalman filters in random formats, with limits within which to examine them; a seed determines each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guarantee import limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference_states

STEPS = 200
"""Steps of a run."""
DETERMINISTIC = tuple(each for each in Rounding if each not in (Rounding.STOCHASTIC, Rounding.HALF_UP))
"""Roundings of the filters that a seed draws."""
KINDS = ("plain", "singular", "nearly singular", "cycle", "unstable", "unseen")
"""Covariances of full rank; without it; almost without it; matrices that change; a transition with growing states that
are observable; and H = 0."""
RANGES = ("unlimited", "subnormal", "flushed")
LIMITED = ("measurement", "state and innovation", "all", "reached")
"""Quantities with limits; the last word means what the exact filter reaches with constant measurements."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A filter, limits within which it is examined, and a level of measurements, (m,)."""

    kind: str
    model: LinearModel
    fmt: FloatFormat
    form: Form
    limited: str
    within: FilterLimits
    level: NDArray[np.float64]

    @cached_property
    def stored(self) -> LinearModel:
        """The model of the exact filter."""
        return self.model.rounded(self.fmt)


def draw(seed: int) -> Drawn:
    """Draw a filter; its seed determines all random numbers."""
    rng = np.random.default_rng([35, seed])
    form, kind = WITH_PROGRAM[seed % len(WITH_PROGRAM)], KINDS[seed // len(WITH_PROGRAM) % len(KINDS)]
    fmt = _format(rng)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 3))
    model = _model(rng, kind, n, m)
    # Factors of a singular covariance may be those of another one. Where few products are rounded, and limits are just
    # those that a filter reaches, this is the largest part of an error.
    degenerate = "singular" in kind
    limited = LIMITED[int(rng.choice(4, p=(0.2, 0.2, 0.1, 0.5) if degenerate else (0.4, 0.25, 0.1, 0.25)))]
    Z = 10.0 ** rng.uniform(-2, 3, m)
    X, V = 10.0 ** rng.uniform(-1, 3, n), 10.0 ** rng.uniform(-1, 2.5, m)
    # The first estimate, and the innovation of a first measurement of zero, must be within their limits.
    first = np.abs(model.H[0] @ model.Phi[0] @ model.x0).astype(np.float64)
    X, V = np.maximum(X, 2 * np.abs(model.x0.astype(np.float64))), np.maximum(V, 2 * first)
    if limited == "reached":
        reached = _reached(model, fmt, Z)
        if reached is not None:
            return Drawn(kind, model, fmt, form, limited, reached, Z)
        limited = "measurement"
    if limited == "measurement":
        within = limits(measurement=Z)
    else:
        within = limits(state=X, innovation=V, measurement=Z if limited == "all" else math.inf)
    return Drawn(kind, model, fmt, form, limited, within, Z)


def _reached(model: LinearModel, fmt: FloatFormat, Z: NDArray[np.float64]) -> FilterLimits | None:
    """Return the limits that the exact filter reaches with constant measurements, if it can be stored and computed."""
    try:
        stored = model.rounded(fmt)
        z = fmt.array(np.broadcast_to(Z, (STEPS, len(Z)))).to_fractions()
        true = reference_states(stored, z)[:, :, 0]
    except (ValueError, ArithmeticError):
        return None
    first = np.maximum(np.abs(stored.x0.astype(np.float64)), np.abs(model.x0.astype(np.float64)))
    innovation = np.abs(innovations(stored, true, z.astype(np.float64)))
    X = np.maximum(np.abs(true).max(axis=0), first)
    return limits(state=X * (1 + 2.0**-30), innovation=innovation.max(axis=0) * (1 + 2.0**-30))


def _format(rng: np.random.Generator) -> FloatFormat:
    base = int(rng.choice((2, 3, 10, 16), p=(0.55, 0.02, 0.26, 0.17)))
    most = {2: 31, 3: 31, 10: 20, 16: 15}[base]
    precision = int(rng.integers(3, most if rng.random() < 0.7 else 3 + most // 4))
    rounding = DETERMINISTIC[int(rng.integers(len(DETERMINISTIC)))]
    kind = RANGES[int(rng.choice(3, p=(0.5, 0.25, 0.25)))]
    if kind == "unlimited":
        return FloatFormat(base, precision, rounding)
    digit = math.log2(base)
    emin, emax = -int(rng.integers(8, 60) / digit), int(rng.integers(12, 60) / digit)
    return FloatFormat(base, precision, rounding, emin, emax, kind == "subnormal")


def _model(rng: np.random.Generator, kind: str, n: int, m: int) -> LinearModel:
    """Draw a model of exact fractions."""
    cycled = rng.random(4) < (0.6 if kind == "cycle" else 0.0)
    if kind == "cycle" and not cycled.any():
        cycled[int(rng.integers(4))] = True
    periods = [int(rng.integers(2, 4)) if each else 1 for each in cycled]
    Phi = [_transition(rng, n, kind == "unstable") for _ in range(periods[0])]
    H = [_fractions(rng, m, n) for _ in range(periods[1])]
    if kind == "unseen":
        H = [0 * each for each in H]
    rank = int(rng.integers(0, n)) if "singular" in kind else n
    extra = Fraction(1, 2 ** int(rng.integers(8, 40))) if kind == "nearly singular" else Fraction(0)
    Q = [_square(rng, n, rank, extra) for _ in range(periods[2])]
    if kind == "nearly singular" and m == 2:
        R = [_square(rng, m, 1, Fraction(1, 2 ** int(rng.integers(3, 16)))) for _ in range(periods[3])]
    else:
        R = [_square(rng, m, m, Fraction(1, 2 ** int(rng.integers(2, 6)))) for _ in range(periods[3])]
    first = n if kind != "singular" else int(rng.integers(0, n + 1))
    P0 = _square(rng, n, first, extra)
    x0 = _fractions(rng, n, 1)[:, 0] if rng.random() < 0.3 else exact(np.zeros(n, dtype=int))
    if kind != "unstable" and rng.random() < (0.7 if "singular" in kind else 0.4):  # few products are rounded
        unit = exact(np.eye(n, dtype=int))
        Phi = [unit * _eighths(rng, n) for _ in Phi]
        H = [each if kind == "unseen" else _eighths(rng, (m, n)) for each in H]
        R, P0 = [exact(np.eye(m, dtype=int)) / 4 for _ in R], P0 if kind == "singular" else unit
    return LinearModel(np.array(Phi), np.array(H), np.array(Q), np.array(R), x0, P0, name=f"a filter, {kind}")


def _fractions(rng: np.random.Generator, rows: int, columns: int) -> NDArray[Any]:
    """Draw fractions near one; with short denominators in some matrices, and zeros in others."""
    denominators = (4, 8) if rng.random() < 0.3 else (50, 103)
    zeros = 0.3 if rng.random() < 0.3 else 0.0
    found = np.empty((rows, columns), dtype=object)
    for index in np.ndindex(rows, columns):
        below = int(rng.integers(*denominators))
        above = int(rng.integers(-2 * below, 2 * below + 1)) or 1
        found[index] = Fraction(0) if rng.random() < zeros else Fraction(above, below)
    return found


def _eighths(rng: np.random.Generator, shape: Any) -> NDArray[Any]:
    """Draw eighths, many of them zero or a power of two."""
    return np.asarray(exact(rng.choice((0, 1, 1, 2, 3, 4, 5, -1, -2, -3), shape)) / 8)


def _transition(rng: np.random.Generator, n: int, growing: bool) -> NDArray[Any]:
    """Draw a transition matrix whose states decay, or one whose states grow or integrate each other."""
    if growing and rng.random() < 0.3:
        dt = Fraction(1, int(rng.integers(2, 20)))
        return exact([[dt ** (j - i) / math.factorial(j - i) if j >= i else 0 for j in range(n)] for i in range(n)])
    radius = rng.uniform(1.0, 1.4) if growing else rng.uniform(0.1, 0.98)
    given = np.diag(rng.uniform(-1, 1, n)) if rng.random() < 0.2 else rng.standard_normal((n, n))
    given *= radius / max(float(np.abs(np.linalg.eigvals(given)).max()), 1e-3)
    below = int(rng.choice((64, 1000, 1024, 999)))
    return exact([[Fraction(round(x * below), below) for x in row] for row in given])


def _square(rng: np.random.Generator, n: int, rank: int, extra: Fraction) -> NDArray[Any]:
    """Draw a covariance G G' of some rank, and add to its variances."""
    G = _fractions(rng, n, max(rank, 1)) * (1 if rank else 0) * Fraction(2) ** int(rng.integers(-5, 3))
    return np.asarray(G @ G.T + extra * exact(np.eye(n, dtype=int)))


def innovations(stored: LinearModel, true: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the innovations of the exact filter, (steps, m)."""
    Phi, H, k = stored.Phi.astype(np.float64), stored.H.astype(np.float64), np.arange(len(z))
    before = np.concatenate([stored.x0.astype(np.float64)[None], true[:-1]])
    predicted = np.einsum("kij,kj->ki", Phi[k % len(Phi)], before)
    return np.asarray(z - np.einsum("kij,kj->ki", H[k % len(H)], predicted))
