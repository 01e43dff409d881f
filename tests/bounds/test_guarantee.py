"""The guarantee for every measurement and for all time: its program, its terms, its sums, and runs against it."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from gpbnb import FloatFormat, LinearSystem, Rounding
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.gains import filter_schedule, schedule
from gpbnb.bounds.guarantee import from_schedule, guarantee, limits
from gpbnb.bounds.guess import GAIN, float_errors, gains, linear_steps, rounding_errors, value_sizes
from gpbnb.bounds.probable import probable_error, separate_roundings
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import as_packed
from gpbnb.filters.recording import system_step
from gpbnb.filters.run import Run
from gpbnb.filters.stepping import RunningStep
from gpbnb.filters.structures import state_space
from gpbnb.report.guarantees.adversary import attack, ceiling, random_errors, run_against
from gpbnb.report.guarantees.published import nile_local_level
from gpbnb.report.kalman.exact_step import exact_step
from tests.plain_program import steps_in_python
from tests.small_filter import named_operations

FORMATS = [
    FloatFormat(2, 24),
    FloatFormat(2, 9, Rounding.CHOP),
    FloatFormat(10, 6),
    FloatFormat(10, 12, Rounding.CHOP),
    FloatFormat(16, 5),
]


def tracker(**changes: object) -> LinearModel:
    given: dict[str, object] = {
        "Phi": exact([["1", "0.1"], ["0", "1"]]),
        "H": exact([["1", "0"]]),
        "Q": exact([["1/30000", "1/2000"], ["1/2000", "1/100"]]),
        "R": exact([["4"]]),
        "x0": exact(["0", "0"]),
        "P0": exact([["100", "0"], ["0", "100"]]),
    }
    return LinearModel(**(given | changes))


def rolling() -> LinearModel:
    """Two measurements with correlated noise, and a cycle of three: nothing in it is 1 or 0 that hides an error."""
    Phi = exact([["0.9", "0.1"], ["-0.2", "0.8"]])
    H = np.array(
        [exact([["1", "0.5"], ["0.3", "-1"]]), exact([["0", "1"], ["2", "0.7"]]), exact([["1", "0"], ["0", "0"]])]
    )
    return tracker(Phi=Phi, H=H, R=exact([["2", "0.5"], ["0.5", "1"]]), P0=exact([["3", "1"], ["1", "2"]]))


# -- the program ------------------------------------------------------------------------------------------------------


# The loops take long to compile. All formats share them, except that base 10 stores an entry as two numbers.
@pytest.mark.parametrize("form", WITH_PROGRAM)
@pytest.mark.parametrize("fmt", FORMATS[:3], ids=str)
def test_the_program_gives_the_digits_of_the_filter(form: Form, fmt: FloatFormat) -> None:
    model, steps = replace(rolling(), x0=exact(["7", "-3"])), 12
    given = schedule(model, fmt, form, 40)
    z = np.random.default_rng(1).uniform(-100, 100, (steps, 2))
    run = Run(model, fmt, form, range(1, steps + 1))
    run.take(z)
    x, found = as_packed(fmt, given.x0), []
    for row, each in zip(given.rows(np.arange(steps)), z, strict=True):
        steps_of = RunningStep(system_step(given.program), [fmt], [given.packed[row][None]], tag=run.tag)
        (states,), _, stop, _ = steps_of.take(0, [x], as_packed(fmt, each[None]))
        assert stop is None
        x = states[0].reshape(x.shape)
        found.append(x)
    assert np.array_equal(run.exactly(np.array(found)), run.checkpoints().x)


# -- the recursion of the error, in exact fractions -----------------------------------------------------------------


@pytest.mark.parametrize("form", [Form.HUNG, Form.INNOVATION, Form.UD])
def test_the_error_is_what_its_terms_add_up_to(form: Form) -> None:
    """With the rounding errors that were made, e = F̂e + ΔF x + (K̂ - K)ν + Γρ to the last bit."""
    model, fmt = rolling(), FloatFormat(2, 12)
    stored, given = model.rounded(fmt), schedule(model, fmt, form, 60)
    program, n = given.program, model.n
    within = limits(state=100, innovation=100, measurement=100)
    found = linear_steps(given, np.arange(7))
    h = rounding_errors(
        program, found, value_sizes(found, within), np.full(2, 101.0), np.ones(2), float_errors(program, fmt, found)
    )
    rng, x, true, P = np.random.default_rng(3), [Fraction(0)] * n, [Fraction(0)] * n, stored.P0
    for k in range(7):
        z = [fmt.round(float(v)) for v in rng.uniform(-50, 50, 2)]
        made: list[Fraction] = []

        def noted(exactly: Fraction, made: list[Fraction] = made) -> Fraction:
            made.append(fmt.round(exactly) - exactly)
            return exactly + made[-1]

        stored_coefficients = [Fraction(c) for c in given.coefficients[k, :, 0]]
        before = np.array(x) - np.array(true)
        x = steps_in_python(named_operations(program), program.outputs, noted, stored_coefficients, [*x, *z])
        parts = (each[k % len(each)] for each in (stored.Phi, stored.H, stored.Q, stored.R))
        step = exact_step(*parts, true, P, z)
        total = exact(found.F[k]) @ before + exact(found.loop[k]) @ np.array(true)
        total += exact(found.gain[k]) @ step.innovation
        for o, rho in enumerate(made):
            effect = _effect(program, stored_coefficients, o, n)
            assert np.allclose(effect.astype(float), found.effects[n + program.m + o, k], rtol=1e-12, atol=1e-14)
            assert abs(rho) <= h[o, k]
            total += effect * rho
        true, P = list(step.x), step.P
        error = np.array(x) - np.array(true)
        assert np.abs((error - total).astype(float)).max() <= 1e-11 * np.abs(error.astype(float)).max() + 1e-13


def _effect(program: Any, coefficients: list[Fraction], o: int, n: int) -> np.ndarray:
    """What an error of 1 in operation o does to the result, by running the program with it, without rounding."""
    at = -1

    def disturbed(exactly: Fraction) -> Fraction:
        nonlocal at
        at += 1
        return exactly + (1 if at == o else 0)

    nothing = [Fraction(0)] * (n + program.m)
    return np.array(steps_in_python(named_operations(program), program.outputs, disturbed, coefficients, nothing))


# -- units and sums ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("radius", "steps", "lags"),
    [(0.95, None, 1024), (0.999, None, 4096), (1.0, 10_000, 1024), (1.02, 300, 1024)],
)
def test_sums_by_squares_are_those_of_every_step(radius: float, steps: int | None, lags: int) -> None:
    """Added up one by one; blocks lose where a state is a difference of others, and count one block more."""
    rng = np.random.default_rng(5)
    A, B = rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    A = A if steps is None else np.diag(np.diag(A)) * radius / np.abs(np.diag(A)).max()
    found, response, gain = gains(A, B, np.zeros((0, 4)), steps, lags), B, np.zeros((4, 2))
    for _ in range(40_000 if steps is None else steps):  # what is left after so many is negligible
        response, gain = A @ response, gain + np.abs(response)
    assert (found >= gain * (1 - 1e-9)).all()
    assert (found <= gain * (1.5 if steps is None else 1.15)).all()


# -- the guarantee ----------------------------------------------------------------------------------------------------


@pytest.mark.long  # attacks in every form
@pytest.mark.parametrize(("form", "rounding"), [*zip(WITH_PROGRAM, itertools.cycle(Rounding.documented()))])
def test_an_adversary_comes_near_but_not_above(form: Form, rounding: Rounding) -> None:
    """Measured with these seeds: 0.33 to 0.73."""
    found = guarantee(tracker(), FloatFormat(2, 24, rounding), limits(state=[1000, 30], innovation=8), form=form)
    assert found.for_ever
    outcome = attack(found, 1500, 100, center=[750, 0], plans=1)
    assert outcome.admissible
    assert 0.3 < outcome.ratio <= 1


def test_an_attack_takes_the_candidate_within_the_limits_whose_error_is_largest_one_step_later() -> None:
    fmt = FloatFormat(2, 9)
    found = from_schedule(
        filter_schedule(LinearSystem.from_coefficients(["0.2", "0.1", "0.05"], [1, "-0.5", "0.3"]).as_filter(), fmt),
        limits(measurement=1),
    )
    n, rng = found.schedule.program.n, np.random.default_rng(4)

    def ran(rows: Any, pool: Any, ahead: bool = False) -> Any:
        return [each[0] for each in run_against(found, rows[None], pool[None], ahead=ahead)]

    def errors(rows: Any, *z: float) -> Any:
        return ran(rows, np.reshape(z, (2, 1, 1)))[2]

    for _ in range(8):
        pool, rows = rng.uniform(-1, 1, (2, 6, 1)), rng.standard_normal((2, n))
        pool[0, 2], pool[1, 4] = 1.6, -1.2
        outside, z, _ = ran(rows, pool, ahead=True)
        inside = [[each for each in some[:, 0].tolist() if abs(each) <= 1] for some in pool]
        first = max(inside[0], key=lambda q: rows[1] @ errors(rows, q, float(pool[1, 0, 0]))[1])
        second = max(inside[1], key=lambda q: rows[1] @ errors(rows, first, q)[1])
        assert (outside, z[:, 0].tolist()) == (0, [float(fmt.round(first)), float(fmt.round(second))])
    assert ran(rows, np.full((2, 3, 1), 1.5))[0] == 2


def test_the_error_of_the_gain_matters() -> None:
    """The first gain of the Nile filter cancels: without its part, an admissible run violates the bound."""
    found = guarantee(nile_local_level(), FloatFormat(2, 24), limits(state=1500, innovation=1200))
    outcome = attack(found, 300, 100, center=[1000], plans=2)
    assert outcome.admissible
    assert found.bound[0] - found.parts[0, GAIN] < outcome.errors[0] <= found.bound[0]


def test_the_probable_error_of_a_periodic_model_is_the_largest_of_its_steps() -> None:
    found = guarantee(rolling(), FloatFormat(2, 24), limits(state=100, innovation=10))
    F, effects, errors = separate_roundings(found)
    G = effects * errors[:, None, :] / math.sqrt(3)
    covariance, steps = np.zeros((2, 2)), []
    for k in range(40 * len(F)):
        covariance = F[k % len(F)] @ covariance @ F[k % len(F)].T + G[k % len(F)] @ G[k % len(F)].T
        steps.append(np.diagonal(covariance))
    scatter = np.sqrt(steps[-len(F) :])
    assert (np.ptp(scatter, axis=0) > 0.01 * scatter.max()).any()
    assert np.allclose(probable_error(found), scatter.max(axis=0), rtol=1e-9, atol=0)


@pytest.mark.long  # 20,000 steps, each with roundings drawn at random
def test_the_probable_error_is_the_scatter_of_an_emulated_run() -> None:
    """Near the limits, where roundings are as large as assumed; measured: 0.99 and 1.04 of it.

    Errors are correlated over 20 steps, so that 10,000 steps give the scatter to 3 %; the test allows three times that.
    """
    found = guarantee(tracker(), FloatFormat(2, 24), limits(state=[1000, 30], innovation=8))
    scatter = random_errors(found, 20_000, [750, 0])[10_000:].std(axis=0)
    assert (0.9 * probable_error(found) < scatter).all()
    assert (scatter < 1.1 * probable_error(found)).all()


def test_the_ceiling_adds_up_roundings_by_the_size_of_their_results():
    """x = 0.5625 x + 0.4375 z in five bits, with z = 0.75."""
    schedule = filter_schedule(state_space([["0.5625"]], [["0.4375"]], [[1]], [[0]]), FloatFormat(2, 5))
    found = from_schedule(schedule, limits(measurement=1.0))
    z = np.full((3, 1), 0.75)
    x, total = 0.0, 0.0
    half = {k: 2.0 ** (k - 6) for k in range(-8, 2)}  # largest error of results below 2**k
    for _ in range(3):
        products = 0.5625 * x, 0.4375 * 0.75
        sizes = [abs(each) for each in (*products, sum(products)) if each]
        sizes = sizes if x else sizes[:1]
        total = 0.5625 * total + sum(half[math.frexp(each)[1]] for each in sizes)
        x = sum(products)
    assert ceiling(found, z, 0) == pytest.approx(total, rel=1e-12)
