"""Known inputs, offsets, matrices as functions of the step, and the forms written with array operations."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from small_filter import exact_steps

from gpbnb import FloatFormat, LinearModel, Rounding, required_precision
from gpbnb.filters.emulation import compare_runs, emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run, reference
from gpbnb.filters.simulation import Simulation, fine_resolution, simulated_measurements

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


def test_a_run_that_goes_on_counts_the_steps_before():
    model = drawn()
    run, z = Run(model, FloatFormat(2, 20), Form.INNOVATION, ()), np.zeros((STEPS, model.m))
    run.take(z[1:])
    with pytest.raises(ValueError, match=f"got {STEPS + 1} steps; needed at most {STEPS}"):
        run.take(z[:2])


def test_without_inputs_the_simulation_is_that_of_the_model():
    model = drawn(8)
    plain = model.without_inputs()
    assert not plain.has_inputs
    z = simulated_measurements(model, STEPS)
    silent = simulated_measurements(plain, STEPS)
    assert not np.array_equal(z, silent)
    simulation = Simulation(plain, tuple(map(float, plain.x0)), 0, fine_resolution(plain))
    assert np.array_equal(silent, simulation.measurements(STEPS))
    x = np.zeros(model.n)
    for k, moved in enumerate(z - silent):  # each matrix has a cycle of its own
        Phi, H, B, b, d = (
            each[k % len(each)].astype(float) for each in (model.Phi, model.H, model.B, model.b, model.d)
        )
        x = Phi @ x + B @ model.u[k].astype(float) + b
        assert moved == pytest.approx(H @ x + d, abs=2 * max(fine_resolution(model)))
    walk = LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1]])
    assert (simulated_measurements(replace(walk, d=["0.25"]), 9) - simulated_measurements(walk, 9) == 0.25).all()


CART = {
    "Phi": [[1, "0.1"], [0, 1]],
    "H": [[1, 0]],
    "Q": [["1e-6", 0], [0, "1e-4"]],
    "R": [["0.04"]],
    "x0": [0, 0],
    "P0": [[1, 0], [0, 1]],
}


@pytest.mark.parametrize("basis", ["emulation", "bound"])
def test_answers_with_inputs(basis):
    u = np.sin(np.arange(60) / 7).reshape(-1, 1)
    cart = LinearModel(**CART, B=[["0.005"], ["0.1"]], u=u, d=["0.5"])
    answer = required_precision(cart, 60, [1e-3, 1e-2], basis=basis)
    assert answer.format is not None
    assert answer.ratio <= 1 < dict(answer.tried)[answer.digits - 1]


def test_functions_of_the_step_are_cycles():
    def transition(k):
        return [[1, Fraction(k, 100)], [0, Fraction(9, 10)]]

    varying = LinearModel(**CART | {"Phi": transition}, steps=30)
    cycle = LinearModel(**CART | {"Phi": [transition(k) for k in range(1, 31)]})
    z = simulated_measurements(varying, 30)
    assert varying.Phi.shape == (30, 2, 2)
    for basis in ("emulation", "bound"):
        a, b = (required_precision(each, z, 1e-2, basis=basis).tried for each in (varying, cycle))
        assert a == b


def test_random_rounding_stores_one_model_whose_covariances_are_symmetric():
    """The stored model is the one that a run takes, with its inputs, too."""
    fmt = FloatFormat(2, 9, Rounding.STOCHASTIC, seed=4)
    model = replace(drawn(), P0=np.eye(3) + drawn().Q[0])
    assert np.any(fmt.array(model.P0) != fmt.array(model.P0).T)
    stored = model.rounded(fmt)
    run = Run(model, fmt, Form.INNOVATION, range(1, STEPS + 1))
    assert np.array_equal(run.exactly(run.x)[:, 0], stored.x0)
    assert np.array_equal(run.exactly(run.P), stored.P0)
    z = simulated_measurements(model, STEPS, 1)
    assert 0 < emulate(model, z, fmt, "symmetrized").state.max() < 1
