"""The innovation form of the filter written with arrays: what compiled runs must give, digit for digit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.filters.model import LinearModel


def estimates(
    model: LinearModel, z: Any, fmt: Any, times: Callable[[Any, Any], Any], compensated: bool = False
) -> NDArray[Any]:
    """The estimates after each step, (steps, n), exact; `times` multiplies matrices."""
    n = model.n
    Phi, H, Q, R = ([fmt.array(each) for each in cycle] for cycle in (model.Phi, model.H, model.Q, model.R))
    increments = [fmt.array(each - np.eye(n, dtype=int)) for each in model.Phi]
    x, P = fmt.array(model.x0.reshape(n, 1)), fmt.array(model.P0)
    carried, identity = fmt.array(np.zeros((n, 1))), fmt.array(np.eye(n))
    found = []
    for k, measured in enumerate(fmt.array(z)):
        phi, h, q, r = (each[k % len(each)] for each in (Phi, H, Q, R))
        V = times(times(phi, P), phi.T) + q
        PHt = times(V, h.T)
        K = times(PHt, linalg.inv(times(h, PHt) + r))
        P = times(identity - times(K, h), V)
        if compensated:
            d = times(increments[k % len(increments)], x)
            d = (d + times(K, measured[:, np.newaxis] - times(h, x + d))) - carried
            total = x + d
            carried, x = (total - x) - d, total
        else:
            u = times(phi, x)
            x = u + times(K, measured[:, np.newaxis] - times(h, u))
        found.append(x[:, 0].to_fractions())
    return np.array(found, dtype=object)
