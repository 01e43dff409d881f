"""Names of states, measurements, inputs and outputs, and how models and surveys describe themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import dlti

from gpbnb import BINARY16, BINARY32, FloatFormat, LinearModel, LinearSystem, limits, read_model, required_precision
from gpbnb.filters.system import unobserved
from gpbnb.wordlength.examples import TILT_STATES, tilt
from gpbnb.wordlength.records import survey_records

NAMES = [f"{name} ({unit})" for name, unit in TILT_STATES]
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


def test_a_survey_is_shown_as_a_table():
    walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
    found = survey_records(walk, 3, 0.01, [FloatFormat(2, 4), BINARY16, BINARY32, FloatFormat(10, 7, "chop")], steps=20)
    header, columns, *rows = repr(found).splitlines()
    assert header == "3 records in each format"
    assert " ".join(columns.split()) == "format within the tolerance largest error / tolerance"
    assert {len(row) for row in rows} == {len(columns)}
    names = ("4 bits", "BINARY16", "BINARY32", "7 decimal digits, chopped")
    for i, (row, name) in enumerate(zip(rows, names, strict=True)):
        share, worst = f"{100 * found.shares[i]:.0f}%", f"{found.ratios[:, i].max():.3g}"
        assert row.split() == [*name.split(), share, worst]
    assert len(repr(replace_ratios(found))) < 600


def replace_ratios(found):
    return found._replace(ratios=np.tile(found.ratios, (1000, 1)))


def test_names_stay_with_a_model_that_is_changed():
    z = np.array([[1.0], [math.nan], [2.0]])
    for changed in (CART.rounded(BINARY32), CART.without_missing(z)[0], replace(CART, steps=2, u=CART.u[:2])):
        assert (changed.state_names, changed.measurement_names) == (CART.state_names, CART.measurement_names)
        assert changed.input_names == CART.input_names
    assert CART.without_inputs().input_names == ()
    assert CART.without_inputs().state_names == CART.state_names


@pytest.mark.parametrize(
    ("names", "error", "message"),
    [
        (["a"], ValueError, "got 1 state_names, 'a'; needed 3 names"),
        (["a", "a", "b"], ValueError, "got state_names 'a', 'a', 'b'; needed 3 different names that are not empty"),
        (["a", " ", "b"], ValueError, "needed 3 different names that are not empty"),
        (["a", 1, "b"], TypeError, r"got state_names \['a', 1, 'b'\]; needed a list of 3 names"),
        ("abc", ValueError, "got 1 state_names, 'abc'; needed 3 names"),
        (7, TypeError, "got state_names 7; needed a list of 3 names"),
    ],
)
def test_names_that_do_not_fit_are_refused(names, error, message):
    with pytest.raises(error, match=message):
        replace(tilt(), state_names=names)


def test_messages_name_the_state():
    grown = LinearSystem([["0.5", 0], [0, "1.5"]], [[1], [1]], state_names=["current (A)", "speed [m/s]"])
    assert grown.unstable().endswith('an eigenvalue of size 1.5, mostly in state "speed"')
    assert replace(grown, state_names=()).unstable().endswith("an eigenvalue of size 1.5, mostly in state 1")
    lost = unobserved(np.asarray(grown.A), np.asarray([grown.A[0]]), grown.state_names)
    assert lost.endswith('with an eigenvalue of size 1.5, mostly in state "speed"')
    with pytest.raises(OverflowError, match='state "speed" at step 1: got a number beyond the range of float64'):
        replace(grown, x0=[0, "1e200"], A=[[0, 0], [0, "1e200"]]).outputs([[0]] * 3)
    with pytest.raises(OverflowError, match=r'output "speed" at step \d: got'):
        replace(
            grown, x0=[0, "1e200"], A=[[0, 0], [0, "0.5"]], C=[[0, "1e160"]], D=[[0]], output_names=["speed (m/s)"]
        ).outputs([[0]] * 3)
    with pytest.raises(ValueError, match='got inf for measurement "range" of step 2'):
        required_precision(CART, [[1], [math.inf], [2]], 0.1)


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


def test_a_question_reads_what_read_model_reads(tmp_path):
    """A system of SciPy was refused; a StateSpace of python-control can be called, but is no function."""
    control = pytest.importorskip("control")
    z = np.arange(6.0).reshape(-1, 1) / 8
    matrices = [[0.5]], [[1.0]], [[1.0]], [[0.0]]
    expected = required_precision(LinearSystem(*matrices), z, 0.01)
    (tmp_path / "system.toml").write_text("A = [[0.5]]\nB = [[1]]\n")
    for given in (
        dlti(*matrices, dt=1),
        control.ss(*matrices, 1),
        tmp_path / "system.toml",
        str(tmp_path / "system.toml"),
        {"A": [[0.5]], "B": [[1]]},
    ):
        assert required_precision(given, z, 0.01) == expected
    with pytest.raises(TypeError, match="got a int; needed the path of a TOML file"):
        required_precision(7, 6, 0.01)
