"""gpbnb.wordlength.models beside the real libraries: the same estimates, or a refusal that names the cause."""

from __future__ import annotations

import control
import numpy as np
import pytest
from filterpy.common import inv_diagonal
from filterpy.kalman import (
    FadingKalmanFilter,
    KalmanFilter,
    SquareRootKalmanFilter,
)
from scipy import signal

from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference_states
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.models import read_model

STEPS = 40
RNG = np.random.default_rng(5)
Z = np.round(np.cumsum(RNG.standard_normal((STEPS, 2)), axis=0), 3)
U = np.round(RNG.standard_normal((STEPS, 2)), 3)
# Both libraries compute in float64; in 40 steps of a stable filter their errors stay far below this.
CLOSE = {"rtol": 1e-9, "atol": 1e-9}


def tracker(kind=KalmanFilter, column=True, inputs=False):
    """A filter with three states and two measurements, after three steps, in which every matrix is asymmetric."""
    made = FadingKalmanFilter(1.0, 3, 2) if kind is FadingKalmanFilter else kind(dim_x=3, dim_z=2, dim_u=2)
    made.F = np.array([[0.9, 0.2, 0.1], [-0.1, 0.8, 0.3], [0.0, -0.2, 0.7]])
    made.H = np.array([[1.0, 0.5, 0.0], [0.0, -0.3, 2.0]])
    made.Q = np.array([[0.3, 0.1, 0.0], [0.1, 0.2, -0.05], [0.0, -0.05, 0.1]])
    made.R = np.array([[0.5, 0.1], [0.1, 0.4]])
    made.P = np.array([[2.0, 0.3, 0.1], [0.3, 1.5, 0.2], [0.1, 0.2, 1.0]])
    made.x = np.array([1.0, -2.0, 0.5]).reshape((3, 1) if column else (3,))
    if inputs:
        made.B = np.array([[0.5, 0.1], [1.0, -0.4], [0.2, 0.3]])
    for z in Z[:3] + 1:
        advance(made, z, np.zeros(2) if inputs else None)
    return made


def advance(given, z, u=None):
    shape = given.x.shape[1:]
    given.predict() if u is None else given.predict(u.reshape(-1, *shape))
    given.update(z.reshape(-1, *shape))
    return given.x.reshape(-1)


def estimates(model, z=Z):
    return reference_states(model, z).sum(axis=2)


@pytest.mark.filterwarnings("ignore:Use KalmanFilter class instead:DeprecationWarning")
@pytest.mark.parametrize("kind", [KalmanFilter, SquareRootKalmanFilter, FadingKalmanFilter])
@pytest.mark.parametrize("inputs", [False, True], ids=["alone", "inputs"])
def test_a_filter_of_filterpy_gives_its_estimates(kind, inputs):
    given = tracker(kind, inputs=inputs)
    model = read_model(given, U if inputs else None)
    assert isinstance(model, LinearModel)
    assert model.name == kind.__name__
    found = estimates(model)
    theirs = [advance(given, z, u if inputs else None) for z, u in zip(Z, U, strict=True)]
    np.testing.assert_allclose(found, theirs, **CLOSE)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("alpha", 1.02, "a fading memory, alpha = 1.02; needed alpha = 1"),
        ("inv", inv_diagonal, "inv = inv_diagonal; needed numpy.linalg.inv"),
        ("_I", 2 * np.eye(3), "another matrix than the identity in _I"),
        ("update", lambda z: None, "its own update; needed the method of its class"),
        ("predict", lambda: None, "its own predict; needed the method of its class"),
    ],
)
def test_what_changes_the_estimates_is_refused_by_name(name, value, message):
    given, plain = tracker(), tracker()
    setattr(given, name, value)
    different = [advance(each, Z[0]).copy() for each in (given, plain)] + [
        advance(each, Z[1]) for each in (given, plain)
    ]
    assert not np.allclose(different[2], different[3], rtol=1e-6)
    with pytest.raises(ValueError, match=f"^got a KalmanFilter with {message}"):
        read_model(given)


def test_inputs_are_used_or_refused():
    given = tracker(inputs=True)
    with pytest.raises(ValueError, match=r"with inputs B; needed u=, of shape \(steps, p\)"):
        read_model(given)
    given.B = np.zeros((3, 2))
    assert read_model(given).B is None
    for B in (None, 0.0, np.zeros((3, 2))):
        given.B = B
        with pytest.raises(ValueError, match="with u= and no inputs B, or B = 0"):
            read_model(given, U)
    given.B = np.ones(3)
    with pytest.raises(ValueError, match=r"B of shape \(3,\); needed \(3, p\)"):
        read_model(given, U)


B2, A2 = signal.butter(3, 0.3)
ZEROS, POLES, GAIN = signal.butter(3, 0.3, output="zpk")
MIMO = [[0.5, 0.1], [-0.2, 0.8]], [[1.0, 0.3], [0.2, -1.0]], [[1.0, 2.0], [0.5, -1.0]], [[0.1, 0.0], [0.0, 0.2]]


@pytest.mark.parametrize(
    "given",
    [
        signal.dlti(B2, A2, dt=0.1),
        signal.dlti(ZEROS, POLES, GAIN, dt=True),
        signal.dlti(*MIMO, dt=2),
        signal.StateSpace(*MIMO, dt=0.5),
        signal.TransferFunction([1, 0.5], [2, -0.6, 0.1], dt=0.1),
        signal.ZerosPolesGain([], [0.5], 2, dt=0.1),
        signal.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.5]]).to_discrete(0.1),
    ],
    ids=lambda given: type(given).__name__,
)
def test_a_system_of_scipy_gives_its_outputs(given):
    model = read_model(given)
    assert isinstance(model, LinearSystem)
    u = U[:, : model.m]
    _, theirs = signal.dlsim(given, u)[:2]
    np.testing.assert_allclose(model.outputs(u).sum(axis=2), theirs, **CLOSE)


@pytest.mark.parametrize(
    "given",
    [
        control.ss(*MIMO, 0.1, name="gimbal"),
        control.ss(*MIMO, True, name="gimbal", inputs=["a", "b"]),
        control.tf([1, 0.5], [2, -0.6, 0.1], 0.1, name="gimbal"),
        control.zpk([0.2], [0.5, -0.1], 2, 0.1, name="gimbal"),
        control.sample_system(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.5]]), 0.1, name="gimbal"),
    ],
    ids=lambda given: type(given).__name__,
)
def test_a_system_of_control_gives_its_outputs(given):
    model = read_model(given)
    assert isinstance(model, LinearSystem)
    assert model.name == "gimbal"
    u = U[:, : model.m]
    times = np.arange(STEPS) * (1 if given.dt is True else given.dt)
    theirs = control.forced_response(given, times, u.T, squeeze=False).outputs.T
    np.testing.assert_allclose(model.outputs(u).sum(axis=2), theirs, **CLOSE)
