"""Figures of guarantees, with bound and errors against the step."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gpbnb.bounds.adversary import run_against
from gpbnb.bounds.guarantee import FilterGuarantee
from gpbnb.bounds.probable import separate_roundings
from gpbnb.report.display.style import OBSERVED, OBSERVED_OTHERS, VALID, envelope, label, legend, loglog


def errors_of(found: FilterGuarantee, z: Any) -> NDArray[np.float64]:
    """Return errors (steps, n) of the run with measurements `z` (steps, m), which are numbers of the format."""
    measured = np.asarray(z, dtype=np.float64)
    n, m = found.schedule.program.n, found.schedule.program.m
    return run_against(found, np.zeros((len(measured), n)), measured[:, None, :], np.zeros((m, n + 1)), False)[2]


def draw_errors(
    ax: Axes,
    found: FilterGuarantee,
    chosen: NDArray[np.float64],
    random: NDArray[np.float64],
    state: int,
    quantity: str,
) -> None:
    """Draw the bound, and bands of the errors that an adversary achieved and that random measurements caused.

    Parameters
    ----------
    chosen, random : (steps, n), errors.
    state : index of the state.
    quantity : its name and unit, for the axis.
    """
    steps = np.arange(1, len(chosen) + 1)
    bound = np.full(len(steps), found.bound[state])
    ax.plot(steps, bound, color=VALID, label="bound for every measurement sequence")
    for errors, colour, words in (
        (chosen, OBSERVED, "measurements chosen by the adversary"),
        (random, OBSERVED_OTHERS[1], "random measurements"),
    ):
        envelope(ax, steps, np.abs(errors[:, state]), color=colour, alpha=0.6, label=words)
    loglog(ax)
    ax.set_ylim(1e-3 * found.bound[state], 50 * found.bound[state])  # room for the legend
    label(ax, "step", f"rounding error of the {quantity}")
    legend(ax, loc="upper left")


def reachable_corners(found: FilterGuarantee) -> NDArray[np.float64]:
    """Return the corners of the set of errors that the roundings of all steps can add up to, (k, 2), in order.

    It is the sum of one line segment for each operation and step, for a filter with two states and a settled gain.
    """
    F, G, limits = (each[-1] for each in separate_roundings(found))
    rows, halves = np.eye(len(F)), list[NDArray[np.float64]]()
    while np.abs(rows).max() > 1e-16:
        halves += [*(rows @ G * limits).T]
        rows = rows @ F
    segments = np.array([half if (half[0], half[1]) > (0, 0) else -half for half in halves if half.any()])
    # Segments whose directions differ only by rounding errors, the order of which is by chance, make one side.
    directions, side = np.unique(np.round(np.arctan2(segments[:, 1], segments[:, 0]), 9), return_inverse=True)
    sides = np.zeros((len(directions), 2))
    np.add.at(sides, side, 2 * segments)
    lower = np.cumsum(np.vstack([-sides.sum(axis=0) / 2, sides]), axis=0)
    return np.vstack([lower, -lower[1:-1]])


def draw_set(
    ax: Axes, found: FilterGuarantee, chosen: NDArray[np.float64], names: tuple[str, str], scale: float = 1.0
) -> None:
    """Draw the set of errors of a filter with two states, its box, and the path of errors that an adversary chose.

    Parameters
    ----------
    chosen : (steps, 2), errors.
    names : name and unit of each state, for the axes.
    scale : units on the axes in a unit of the states, such as 1000 for millimetres.
    """
    corners = scale * reachable_corners(found)
    across, up = scale * found.bound
    box = [-across, across, across, -across, -across], [-up, -up, up, up, -up]
    ax.plot(*box, color=VALID, lw=0.8, label="bound of each state")
    ax.fill(*corners.T, facecolor=VALID, alpha=0.12)
    ax.plot(*np.vstack([corners, corners[:1]]).T, color=VALID, label="errors that roundings can add up to")
    ax.plot(*(scale * chosen).T, color=OBSERVED, lw=0.7, label="path of the adversary")
    legend(ax, loc="lower left", bbox_to_anchor=(0, 1))
    label(ax, f"error of the {names[0]}", f"error of the {names[1]}")
