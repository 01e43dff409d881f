"""Names of states, measurements, inputs and outputs, and how models and surveys describe themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gpbnb import LinearModel, LinearSystem, limits, read_model, required_precision
from gpbnb.wordlength.examples import tilt

CART = LinearModel(
    Phi=[[1, "0.1"], [0, 1]],
    H=[[1, 0]],
    Q=[["1e-6", 0], [0, "1e-4"]],
    R=[["0.04"]],
    x0=[0, 0],
    P0=[[1, 0], [0, 1]],
    name="cart",
    B=[["0.005"], ["0.1"]],
    u=[[1], [1], [0]],
    d=["0.5"],
    state_names=("position (m)", "speed (m/s)"),
    measurement_names=("range (m)",),
    input_names=("push (m/s²)",),
)


def test_a_model_is_shown_in_three_lines():
    assert repr(CART) == str(CART)
    assert repr(CART).splitlines() == [
        "LinearModel 'cart', 2 states: position (m), speed (m/s); 1 measurement: range (m); 1 input: push (m/s²); at "
        "most 3 steps",
        "  Phi (2, 2) 0.1 … 1, H (1, 2) 1, Q (2, 2) 1e-06 … 0.0001, R (1, 1) 0.04",
        "  x0 (2,) 0, P0 (2, 2) 1, B (2, 1) 0.005 … 0.1, u (3, 1) 1, d (1, 1) 0.5",
    ]
    turned = LinearModel(tilt().Phi, [[[0, 1, 1]], [[1, 0, "1e400"]]], tilt().Q, [[1]], tilt().x0, tilt().P0)
    assert "3 states; 1 measurement\n" in repr(turned)
    assert "H (1, 3) 1 … 10**400 in a cycle of 2, Q" in repr(turned)


def test_a_system_is_shown_in_three_lines():
    named = LinearSystem([["0.9"]], [["0.1", 2]], name="smoother", input_names=["a", "b"], output_names=["level (V)"])
    assert repr(named).splitlines() == [
        "LinearSystem 'smoother', 1 state; 2 inputs: a, b; 1 output: level (V)",
        "  A (1, 1) 0.9, B (1, 2) 0.1 … 2",
        "  C (1, 1) 1, D (1, 2) 0, x0 (1,) 0",
    ]


def test_a_process_that_never_settles_is_told_what_to_ask_instead():
    integrator = LinearSystem([[1]], [["0.1"]], state_names=["charge (C)"])
    found = required_precision(integrator, 3, 0.1, basis="probable", within=limits(measurement=1))
    assert 'mostly in state "charge", so that an error of rounding never decays; ask with basis "bound"' in str(found)
    lost = LinearModel(
        [[1, 0], [0, 1]], [[1, 0]], [["0.01", 0], [0, 0]], [[1]], [0, 0], np.eye(2), state_names=["a (m)", "b (m)"]
    )
    found = required_precision(lost, 3, 0.1, basis="probable", within=limits(state=10, innovation=10), highest=3)
    assert 'mostly in state "b"; ask with basis "bound" for a number of steps instead' in str(found)
    with pytest.raises(ValueError, match='got nan for input "u" of step 2; needed a finite number'):
        required_precision(replace(integrator, input_names=["u (A)"]), [[1], [math.nan]], 0.1)


def test_a_model_file_has_names(tmp_path):
    path = tmp_path / "system.toml"
    path.write_text('A = [[0.5]]\nB = [[1]]\nstates = ["level (V)"]\ninputs = ["u"]\noutputs = ["y"]\n')
    system = read_model(path)
    assert (system.state_names, system.input_names, system.output_names) == (("level (V)",), ("u",), ("y",))
    path.write_text('A = [[0.5]]\nB = [[1]]\nmeasurements = ["y"]\n')
    with pytest.raises(ValueError, match=r"system\.toml: measurements unknown"):
        read_model(path)
    given = {"Phi": [[1]], "H": [[1]], "Q": [[1]], "R": [[1]], "x0": [0], "P0": [[1]]}
    model = read_model({**given, "states": ["a (m)"], "measurements": ["b"]})
    assert (model.state_names, model.measurement_names) == (("a (m)",), ("b",))
