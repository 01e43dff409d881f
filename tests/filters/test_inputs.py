"""Known inputs, offsets, matrices as functions of the step, and the forms written with array operations."""

from dataclasses import replace

import numpy as np
import pytest
from small_filter import exact_steps

from gpbnb import FloatFormat, LinearModel
from gpbnb.filters.emulation import compare_runs
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run, reference
from gpbnb.filters.simulation import simulated_measurements

FORMS = tuple(Form)
STEPS = 40


def drawn(seed=0, n=3, m=2, inputs=True, cycle=2):
    """A random stable model with everything that changes from step to step."""
    rng = np.random.default_rng(seed)
    Phi = rng.standard_normal((cycle, n, n)) / 3
    G = rng.standard_normal((n, n)) / 4
    V = rng.standard_normal((m, m)) / 4
    given = LinearModel(
        Phi=Phi,
        H=rng.standard_normal((3, m, n)),
        Q=G @ G.T,
        R=V @ V.T + np.eye(m),
        x0=rng.standard_normal(n),
        P0=np.eye(n),
    )
    if not inputs:
        return given
    return replace(
        given,
        B=rng.standard_normal((2, n, 2)),
        u=rng.standard_normal((STEPS, 2)),
        b=rng.standard_normal(n),
        d=rng.standard_normal((5, m)),
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_reference_with_inputs_is_the_exact_filter(seed):
    model = drawn(seed)
    z = simulated_measurements(model, 6, seed)
    found = reference(model, z, range(1, 7)).x
    true = np.array([step.x for step in exact_steps(model, z)])
    # double-double: 2**-102 an operation, some hundred operations a step
    assert np.abs((found - true).astype(float)).max() < 2.0**-85 * np.abs(true.astype(float)).max()


@pytest.mark.parametrize("form", [form for form in FORMS if form not in (Form.HUNG, Form.HUNG_SECOND_GAIN)], ids=str)
def test_the_bound_holds_with_inputs_and_is_not_vacuous(form):
    model, fmt = drawn(6), FloatFormat(2, 20)
    z = fmt.array(simulated_measurements(model, STEPS))
    steps = tuple(range(1, STEPS + 1))
    run = Run(model, fmt, form, steps, bounded=True)
    run.take(z)
    errors = np.abs(compare_runs(run, reference(model.rounded(fmt), z.to_fractions(), steps)).state)
    bound = run.bounds.state
    assert (errors <= bound).all()
    assert errors.max() > 2.0**-24  # it does round
    assert bound.max() < 2000 * errors.max()
