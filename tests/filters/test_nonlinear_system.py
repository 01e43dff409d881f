"""Systems whose step is a function: runs, searches, and the operations of a step."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    BINARY64,
    FixedFormat,
    FloatFormat,
    NonlinearSystem,
    convert,
    required_precision,
    write_code,
)
from tests.step_functions import SYSTEMS, Native, clipped_controller

needs = pytest.mark.parametrize


def inputs(system, steps, level=0.25):
    return level * np.random.default_rng(7).uniform(-1, 1, (steps, system.m))


@needs("fmt", [(BINARY32, np.float32), (BINARY64, np.float64)], ids=["binary32", "binary64"])
@needs("system", SYSTEMS, ids=lambda each: each.name)
def test_runs_have_the_digits_of_the_processor(system, fmt):
    fmt, native = fmt[0], Native(fmt[1])
    u = inputs(system, 300)
    found = system.states(fmt, u).to_float()
    x, given = native.array([float(each) for each in system.x0]), native.array(u)
    for k, row in enumerate(given):
        x, y = system.step(native, x, row)
        assert x.dtype == y.dtype == native.dtype
        assert found[k].tolist() == [*x.tolist(), *y.tolist()]
    assert np.ptp(found, axis=0).min() > 0.001


def test_one_step_and_a_run_agree():
    system = SYSTEMS[1]
    u = inputs(system, 5)
    found, x = system.states(BINARY32, u), BINARY32.array(system.x0)
    for k in range(5):
        row = system.advance(BINARY32, x, u[k])
        assert row.to_float().tolist() == found[k].to_float().tolist()
        x = row[: system.n]
    assert system(BINARY32, u.ravel()).to_float().tolist() == found[:, 2:].to_float().tolist()


def loop(fmt, u):
    """The same system as a loop of one's own."""
    x, found = fmt.array([0, "0.5"]), []
    for row in u:
        x, y = clipped_controller(fmt, x, row.reshape(1))
        found.append(y)
    return np.stack(found)


def plant_beside(fmt, x, u):
    """A proportional controller, and its plant in a format of its own."""
    exact = FloatFormat(2, 100)
    y, plant = (u - convert(x[0], fmt)) * fmt.array("0.7"), convert(x[0], exact)
    return [plant + (convert(y[0], exact) - plant) * exact.array("0.1")], y


def test_a_state_may_keep_a_format_of_its_own(tmp_path):
    system, fmt, u = NonlinearSystem(plant_beside, [0]), FixedFormat(1, 9), [1] * 50
    x, found = FloatFormat(2, 100).array(0), []
    for _ in u:
        found.append((fmt.array(1) - convert(x, fmt)) * fmt.array("0.7"))
        x = x + (convert(found[-1], x.format) - x) * x.format.array("0.1")
    assert system(fmt, u).to_fractions().ravel().tolist() == [each.to_fractions() for each in found]
    assert system.states(fmt, u).to_fractions()[-1].tolist() == [fmt.round(x.to_fractions()), found[-1].to_fractions()]
    assert required_precision(system, u, "1/1000", kind="fixed").digits == 10  # 11 if the plant is rounded, too
    with pytest.raises(ValueError, match="it converts numbers to another format"):
        write_code(system, fmt, tmp_path)


def test_searches_take_a_system():
    u = inputs(SYSTEMS[0], 60).ravel()
    found, expected = (required_precision(each, u, 1e-3) for each in (SYSTEMS[0], loop))
    assert found.digits == expected.digits > 5
    assert found.tried == expected.tried
    assert not found.notes
    assert (
        required_precision(SYSTEMS[0], u, 1e-3, kind="fixed", like=FixedFormat(2, 1)).format
        == required_precision(loop, u, 1e-3, kind="fixed", like=FixedFormat(2, 1)).format
    )


def test_what_has_no_program_runs_nevertheless():
    branching = NonlinearSystem(lambda fmt, x, u: (x if x[0] > 0 else u, np.sin(u)), [1])
    assert branching(BINARY64, [0.25, 0.5]).to_float().tolist() == [[np.sin(0.25)], [np.sin(0.5)]]
