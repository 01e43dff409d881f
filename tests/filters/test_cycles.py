"""Matrices in cycles of different lengths: whatever takes a model answers as for all cycles written out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gpbnb import (
    BlockFormats,
    FixedFormat,
    FixedIntervalSmoother,
    FloatFormat,
    Form,
    LinearModel,
    emulate,
    guarantee,
    limits,
    survey_records,
)
from gpbnb.filters.run import Run, reference
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.report.wordlengths.study import binary_ranges
from gpbnb.wordlength.required import judge

LENGTHS = {"Phi": 2, "H": 3, "Q": 4, "R": 3, "B": 4, "b": 2, "d": 6}
ALL, STEPS = math.lcm(*LENGTHS.values()), 15
FMT, SHORT = FloatFormat(2, 17), FloatFormat(2, 12, "chop")


def drawn():
    """Two states and two measurements; no member of a cycle is like another."""
    rng = np.random.default_rng(12)
    shapes = {"Phi": (2, 2), "H": (2, 2), "Q": (2, 2), "R": (2, 2), "B": (2, 1), "b": (2,), "d": (2,)}
    given = {name: rng.integers(-8, 9, (LENGTHS[name], *shape)) / 16 for name, shape in shapes.items()}
    for name in ("Q", "R"):
        given[name] = given[name] @ given[name].swapaxes(1, 2) + np.eye(2) / 8
    return LinearModel(**given, x0=[1, "-0.5"], P0=[[2, "0.5"], ["0.5", 1]], u=rng.integers(-8, 9, (STEPS, 1)) / 4)


MODEL = drawn()
WHOLE = replace(
    MODEL, **{name: np.resize(getattr(MODEL, name), (ALL, *getattr(MODEL, name).shape[1:])) for name in LENGTHS}
)
Z = simulated_measurements(MODEL, STEPS, 1)
GAPS = np.where(np.random.default_rng(3).random(Z.shape) < 0.2, np.nan, Z)


def in_pieces(model, ends=(4, 5, 11), **options):
    run = Run(model, FMT, Form.INNOVATION, range(1, STEPS + 1), **options)
    for piece in np.split(Z, ends):
        run.take(piece)
    return run.bounds.state if options else run.checkpoints().x


ANSWERS = {
    "simulated": lambda model: simulated_measurements(model, STEPS, 3),
    **{f"{form}": lambda model, form=form: emulate(model, Z, FMT, form=form).errors for form in tuple(Form)[2:]},
    "Hung (1984)": lambda model: emulate(model.without_inputs(), Z, FMT, form=Form.HUNG).errors,
    "missing": lambda model: emulate(model, GAPS, FMT).errors,
    "fixed": lambda model: emulate(model, Z, FixedFormat(8, 20)).x.to_float(),
    "blocks": lambda model: emulate(model.without_inputs(), Z, BlockFormats(FMT, SHORT, FMT, SHORT)).x.to_float(),
    "pieces": in_pieces,
    "bound in pieces": lambda model: in_pieces(model, bounded=True),
    "reference": lambda model: reference(model, Z, range(1, STEPS + 1)).x,
    "smoother": lambda model: FixedIntervalSmoother(model.without_inputs(), Z).run(FMT).x.to_float(),
    "square-root smoother": lambda model: (
        FixedIntervalSmoother(model.without_inputs(), Z, "square root").run(FMT).x.to_float()
    ),
    "bound": lambda model: judge(model, FMT, Z, 1, form="UD", basis="bound").ratio,
    "companion": lambda model: judge(model.without_inputs(), FMT, Z, 1, form="Hung", basis="bound").ratio,
    "ranges": lambda model: [(each.least, each.largest) for each in binary_ranges(model, Z)],
    "records": lambda model: survey_records(model, 3, 1, [SHORT], steps=STEPS).ratios,
    "guarantee": lambda model: guarantee(model.without_inputs(), FMT, limits(state=9, innovation=9)).bound,
}


@pytest.mark.parametrize("name", ANSWERS)
def test_a_cycle_is_its_members_one_after_the_other(name):
    found, expected = ANSWERS[name](MODEL), ANSWERS[name](WHOLE)
    assert np.array_equal(found, expected)
    assert np.any(found)
    assert np.isfinite(np.asarray(found, dtype=float)).all()
