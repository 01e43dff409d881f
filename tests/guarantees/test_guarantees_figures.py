"""The figure of a guarantee shows the bound above both errors, and reruns measurements exactly."""

from __future__ import annotations

import numpy as np

from gpbnb import FloatFormat
from gpbnb.bounds.adversary import attack, random_errors
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.report.display.style import envelope, figure
from gpbnb.report.guarantees.figures import bound_of, draw_errors, errors_of
from gpbnb.wordlength.examples import tracker


def test_bound_and_errors_step_by_step() -> None:
    found = guarantee(tracker(), FloatFormat(2, 24), limits(2, 1, state=[1000, 30], innovation=8))
    outcome = attack(found, 900, 30, states=[0], center=[750, 0], plans=1)
    chosen, random = errors_of(found, outcome.z), random_errors(found, 900, [750, 0])
    assert np.abs(chosen).max(axis=0)[0] == outcome.errors[0]
    for state in range(2):
        bound = bound_of(found, state, 900)
        assert (np.abs(chosen[:, state]) <= bound).all()
        assert (np.abs(random[:, state]) <= bound).all()
        assert bound.max() == found.bound[state] or bound.max() >= found.bound[state] * (1 - 1e-6)
    _, (ax,) = figure()
    draw_errors(ax, found, chosen, random, 0, "position, m")
    (drawn,) = ax.get_lines()
    assert np.array_equal(drawn.get_ydata(), bound_of(found, 0, 900))
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
