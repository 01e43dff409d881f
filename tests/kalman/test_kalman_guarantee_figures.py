"""The figure of a guarantee shows the bound above both errors, and reruns measurements exactly."""

from __future__ import annotations

import numpy as np

from gpbnb import FloatFormat
from gpbnb.bounds.adversary import attack, random_errors
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.report.display.style import figure
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
    drawn, adversary, noise = ax.get_lines()
    assert np.array_equal(drawn.get_ydata(), bound_of(found, 0, 900))
    assert np.array_equal(adversary.get_ydata(), np.abs(chosen[:, 0]))
    assert np.array_equal(noise.get_ydata(), np.abs(random[:, 0]))
    assert "m" in ax.get_ylabel()


def test_every_line_of_the_figure_can_be_seen() -> None:
    found = guarantee(tracker(), FloatFormat(2, 24), limits(2, 1, state=[1000, 30], innovation=8))
    errors = np.full((5, 2), 1e-6)
    _, (ax,) = figure()
    draw_errors(ax, found, errors, 2 * errors, 0, "position, m")
    bound, chosen, random = (line.get_linewidth() for line in ax.get_lines())
    assert bound >= chosen == 1
    assert random == 0.6
