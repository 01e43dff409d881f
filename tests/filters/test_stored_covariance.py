"""gpbnb.report.kalman: a covariance that a format makes indefinite is stored with raised variances, in every form."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.definiteness import is_definite
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import bounded_steps
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.filters.steps import FACTORED

STEPS = ("0.001", "0.005", "0.01", "0.02", "0.04", "0.05", "0.1", "0.2", "0.3", "0.7")
FORMATS = (FloatFormat(2, 8), FloatFormat(2, 24), FloatFormat(2, 24, Rounding.CHOP), FloatFormat(10, 5))


def chain(n, dt, size="1/3"):
    """A chain of n integrators, driven by white noise of the last derivative: Q has rank one."""
    dt, size = Fraction(dt), Fraction(size)
    column = exact([[dt**2 / 2, dt, Fraction(1)][:n]])
    Phi = np.eye(n) + np.diag([float(dt)] * (n - 1), 1)
    P0 = np.eye(n, dtype=int)
    return LinearModel(exact(Phi), exact(np.eye(1, n)), size**2 * column.T @ column, [["0.25"]], [0] * n, P0)


MODELS = [chain(n, dt) for n in (2, 3) for dt in STEPS]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_every_model_can_be_stored_and_factored(fmt):
    changed = 0
    for model in MODELS:
        stored = model.rounded(fmt)
        assert all(is_definite(each) for each in stored.Q)
        assert np.array_equal(fmt.array(stored.Q).to_fractions(), stored.Q)
        changed += stored.repairs != ()
        run = Run(model, fmt, Form.UD, ())
        assert list(stored.repairs) == run.repairs[: len(stored.repairs)]
        assert len(set(run.repairs)) == len(run.repairs)
        for form in (Form.UD, Form.POTTER, Form.CARLSON):
            assert Run(model, fmt, form, ()).repairs == run.repairs
    assert changed > len(MODELS) / 5


def test_the_variances_are_raised_no_more_than_necessary():
    fmt = FloatFormat(2, 24)
    model = next(each for each in MODELS if each.rounded(fmt).repairs)
    (repair,) = model.rounded(fmt).repairs
    assert (repair.letter, repair.member, repair.asymmetry, repair.fmt) == ("Q", 0, 0.0, fmt)
    unit = float(fmt.unit_roundoff)
    assert unit <= repair.shift <= 4 * model.n * unit
    raised = model.Q[0].copy()
    i = np.arange(model.n)
    raised[i, i] *= 1 + Fraction(repair.shift)
    assert np.array_equal(model.rounded(fmt).Q[0], fmt.array(raised).to_fractions())
    if repair.shift > unit:
        raised[i, i] = model.Q[0].diagonal() * (1 + Fraction(repair.shift / 2))
        assert not is_definite(fmt.array(raised).to_fractions())
    assert "Q, stored in 24 bits" in str(repair)


def test_emulation_and_bound_of_a_raised_covariance_agree():
    """The bound belongs to the covariance that is stored."""
    fmt = FloatFormat(2, 24)
    model = next(each for each in MODELS if each.rounded(fmt).repairs)
    z = simulated_measurements(model, 40, 3)
    history = emulate(model, z, fmt)
    assert history.repairs == tuple(map(str, model.rounded(fmt).repairs))
    for form in (Form.INNOVATION, Form.UD):
        assert 0 < emulate(model, z, fmt, form, bounded=True).ratios().max() <= 1


@pytest.mark.parametrize("form", [Form.UD, Form.POTTER, Form.CARLSON])
def test_a_bound_begins_with_the_distance_of_the_factors_from_the_covariance(form, monkeypatch):
    """Above it, and by no more than a few roundings of float64."""
    model, fmt, asked = chain(2, "0.1"), FloatFormat(2, 8), []
    model = LinearModel(model.Phi, model.H, model.Q, model.R, model.x0, [["3", "1.1"], ["1.1", "0.7"]])
    start = bounded_steps.contraction_start
    monkeypatch.setattr(bounded_steps, "contraction_start", lambda P, x, off: asked.append(off) or start(P, x, off))
    run = Run(model, fmt, form, (1,), bounded=True)
    true = np.abs(FACTORED[form].covariance(run.exactly(run.P)) - model.rounded(fmt).P0)
    assert true.any()
    for off, exactly in zip(asked[0].flat, true.flat, strict=True):
        assert exactly <= Fraction(off) <= exactly * (1 + Fraction(1, 2**49))
