"""Figures of guarantees, with bound and errors against the step."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gpbnb.bounds.adversary import run_against
from gpbnb.bounds.guarantee import Guarantee
from gpbnb.report.display.style import OBSERVED, OBSERVED_OTHERS, VALID, envelope, label, legend, loglog


def errors_of(found: Guarantee, z: Any) -> NDArray[np.float64]:
    """Return errors (steps, n) of the run with measurements `z` (steps, m), which are numbers of the format."""
    measured = np.asarray(z, dtype=np.float64)
    n, m = found.schedule.program.n, found.schedule.program.m
    return run_against(found, np.zeros((len(measured), n)), measured[:, None, :], np.zeros((m, n + 1)), False)[2]


def bound_of(found: Guarantee, state: int, steps: int) -> NDArray[np.float64]:
    """Return the bound of the error of a state after each of the first steps, (steps,)."""
    history = found.history[:steps, state]
    return np.concatenate([history, np.full(steps - len(history), found.bound[state])])


def draw_errors(
    ax: Axes, found: Guarantee, chosen: NDArray[np.float64], random: NDArray[np.float64], state: int, quantity: str
) -> None:
    """Draw the bound, and bands of the errors that an adversary achieved and that random measurements caused.

    Parameters
    ----------
    chosen, random : (steps, n), errors.
    state : index of the state. quantity : its name and unit, for the axis.
    """
    steps = np.arange(1, len(chosen) + 1)
    ax.plot(steps, bound_of(found, state, len(steps)), color=VALID, label="bound for every measurement sequence")
    for errors, colour, words in (
        (chosen, OBSERVED, "measurements chosen by the adversary"),
        (random, OBSERVED_OTHERS[1], "random measurements"),
    ):
        envelope(ax, steps, np.abs(errors[:, state]), color=colour, alpha=0.6, label=words)
    loglog(ax)
    ax.set_ylim(1e-3 * found.bound[state], 50 * found.bound[state])  # room for the legend
    label(ax, "step", f"rounding error of the {quantity}")
    legend(ax, loc="upper left")
