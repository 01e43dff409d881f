"""Compiled simulation of the true state and its measurements."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.compiling import compiled


@compiled
def measured(Phi: Any, H: Any, process: Any, noise: Any, first: int, w: Any, v: Any, x: Any, z: Any) -> None:
    """Propagate the true state x by Phi plus a root of Q times w, and measure it by H plus a root of R times v."""
    n, m = x.shape[0], z.shape[1]
    u = np.empty(n)
    for step in range(z.shape[0]):
        k = first + step
        phi, h = Phi[k % Phi.shape[0]], H[k % H.shape[0]]
        q, r = process[k % process.shape[0]], noise[k % noise.shape[0]]
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += phi[i, j] * x[j]
            for j in range(i + 1):
                s += q[i, j] * w[step, j]
            u[i] = s
        for i in range(n):
            x[i] = u[i]
        for i in range(m):
            s = 0.0
            for j in range(n):
                s += h[i, j] * x[j]
            for j in range(i + 1):
                s += r[i, j] * v[step, j]
            z[step, i] = s
