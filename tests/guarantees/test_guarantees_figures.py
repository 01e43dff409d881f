"""The figure of a guarantee shows the bound above both errors, and reruns measurements exactly."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FloatFormat
from gpbnb.bounds.adversary import attack, random_errors
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.bounds.probable import separate_roundings
from gpbnb.report.display.style import defects, envelope, figure
from gpbnb.report.guarantees.figures import draw_errors, draw_set, errors_of, reachable_corners
from gpbnb.wordlength.examples import tracker


def test_bound_and_errors_step_by_step() -> None:
    found = guarantee(tracker(), FloatFormat(2, 24), limits(2, 1, state=[1000, 30], innovation=8))
    outcome = attack(found, 900, 30, states=[0], center=[750, 0], plans=1)
    chosen, random = errors_of(found, outcome.z), random_errors(found, 900, [750, 0])
    assert np.abs(chosen).max(axis=0)[0] == outcome.errors[0]
    for state in range(2):
        assert (np.abs(chosen[:, state]) <= found.bound[state]).all()
        assert (np.abs(random[:, state]) <= found.bound[state]).all()
    _, (ax,) = figure()
    draw_errors(ax, found, chosen, random, 0, "position, m")
    (drawn,) = ax.get_lines()
    assert np.array_equal(drawn.get_ydata(), np.full(900, found.bound[0]))
    for band, errors in zip(ax.collections, (chosen, random), strict=True):
        heights = band.get_paths()[0].vertices[:, 1]
        assert heights.max() == np.abs(errors[:, 0]).max()
        assert heights.min() == min(error for error in np.abs(errors[:, 0]) if error)
    assert "m" in ax.get_ylabel()


def test_a_band_spans_the_least_and_the_largest_value_of_each_bin() -> None:
    _, (ax,) = figure()
    x = np.arange(1, 101)
    y = np.where(x % 3, x, 0.0)  # a logarithmic axis has no place for zero
    band = envelope(ax, x, y, bins=2)
    corners = {(round(float(a), 6), float(b)) for a, b in band.get_paths()[0].vertices}
    first, second = x[(x < 10) & (x % 3 > 0)], x[(x >= 10) & (x % 3 > 0)]
    middle = [round(float(np.exp(np.log(part).mean())), 6) for part in (first, second)]
    assert corners == {(middle[0], 1.0), (middle[0], 8.0), (middle[1], 10.0), (middle[1], 100.0)}


def test_the_set_is_convex_and_holds_the_path_of_the_adversary() -> None:
    found = guarantee(tracker(), FloatFormat(2, 24), limits(2, 1, state=[1000, 30], innovation=8))
    corners = reachable_corners(found)
    sides = np.diff(np.vstack([corners, corners[:1]]), axis=0)
    after = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
    # Each coordinate of a side is a difference of two corners, which are rounded.
    assert (turns >= -8 * 2.0**-53 * np.abs(corners).max() * np.abs(sides).max()).all()
    # In each direction, the set reaches as far as the roundings of all steps together.
    F, G, most = (each[-1] for each in separate_roundings(found))
    chosen = errors_of(found, attack(found, 900, 30, states=[0], center=[750, 0], plans=1).z)
    for angle in np.linspace(0, np.pi, 25):
        direction = np.array([np.cos(angle), np.sin(angle)])
        reach, row = 0.0, direction
        for _ in range(2500):  # a mode decays by 0.984 a step
            reach += float(np.abs(row @ G) @ most)
            row = row @ F
        assert (corners @ direction).max() == pytest.approx(reach, rel=1e-12)
        assert (corners @ direction).min() == pytest.approx(-reach, rel=1e-12)
        assert np.abs(chosen @ direction).max() <= reach
    _, (ax,) = figure(height=4.2)
    draw_set(ax, found, chosen, ("position (mm)", "velocity (mm/s)"), scale=1000)
    ax.figure.canvas.draw()
    assert defects(ax.figure) == []
    box, boundary, path = ax.get_lines()
    assert np.array_equal(path.get_xydata(), 1000 * chosen)
    assert box.get_xydata().max(axis=0) == pytest.approx(1000 * found.bound)
    assert (boundary.get_xydata().max(axis=0) <= 1000 * found.bound).all()
