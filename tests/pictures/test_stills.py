"""The still figures of the pictures, and the data that their scripts get."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.contributions import contributions
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.report.display import style
from gpbnb.report.examples import tracker
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.pictures import operations, views

PICTURES = pytest.mark.parametrize("picture", views.PICTURES, ids=lambda each: each.id)


@PICTURES
def test_a_still_figure_follows_the_rule_of_figures(picture):
    figure = picture.still()
    figure.canvas.draw()
    assert style.defects(figure) == []
    plt.close(figure)


@PICTURES
def test_what_a_sentence_names_is_computed(picture):
    computed = picture.script()
    assert all(re.search(rf"\b{name}\b", computed) for name in re.findall(r"\{(\w+)\}", picture.sentence))


def test_the_data_of_the_year_are_the_stored_runs():
    data = views.year_data()
    stored = {
        (r.case.precision, r.case.rounding.value): r
        for r in year.load()
        if r.case.model == year.MODELS[0] and r.case.base == 2 and r.case.form.name == "HUNG"
    }
    assert len(data["runs"]) == len(stored)
    for run in data["runs"]:
        found = stored[run["t"], ("nearest", "chop")[run["chop"]]]
        assert data["steps"] == found.steps.tolist()
        for errors, each in zip(run["errors"], (found.rate, found.drift), strict=True):
            np.testing.assert_allclose(errors, np.abs(each).max(axis=1), rtol=5.1e-3)


def test_the_operations_of_the_picture_are_those_that_round():
    found = guarantee(tracker(), FloatFormat(2, 24), limits(state=[1000, 30], innovation=8))
    errors = contributions(found).errors
    lines = [line for line in operations.step_data()["lines"] if line["formula"]]
    assert [line["error"] for line in lines] == pytest.approx(errors[errors > 0], rel=1e-5)
    assert {line["name"]: line["unit"] for line in lines} == dict(
        zip(("a", "b", "c", "d", "e", "x₁′", "x₂′"), ("m", "m", "m", "m", "m/s", "m", "m/s"), strict=True)
    )
