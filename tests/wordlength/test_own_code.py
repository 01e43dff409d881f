"""Functions that a model file names by path: every question works, and a wrong one ends in one line."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gpbnb import NonlinearModel, NonlinearSystem, emulate, read_model, required_precision

CODE = """
import numpy as np
from constants import GAIN

def step(fmt, x, u):
    after = x + (u - x) * fmt.array(GAIN)
    return after, after

def moved(x):
    return np.stack([x[0] + x[1], x[1]])

def seen(x):
    return x[:1] * x[:1]

def mean(fmt, z):
    return sum(z[1:], z[0]) / fmt.array(len(z))

def powers(fmt):
    return [fmt.array("0.9") ** k for k in range(1, 6)]

rate = 3
"""
STEP = 'step = "code/own.py:step"\nx0 = [0]\n'
FILTER = """
f = "code/own.py:moved"
h = "code/own.py:seen"
Q = [[0, 0], [0, 1e-4]]
R = [[0.01]]
x0 = [1, 0.1]
P0 = [[1, 0], [0, 1]]
states = ["x (m)", "v (m/s)"]
"""
Z = [0.5, 1.0, 0.25, 0.75]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "own.py").write_text(CODE)
    (tmp_path / "code" / "constants.py").write_text('GAIN = "0.125"\n')
    for name, text in {"step": STEP, "filter": FILTER, "mean": 'function = "code/own.py:mean"\n'}.items():
        (tmp_path / f"{name}.toml").write_text(text)
    (tmp_path / "z.csv").write_text("z\n" + "".join(f"{each}\n" for each in Z))
    return tmp_path


def test_a_file_is_the_model_that_python_makes_of_its_functions(folder):
    before = [*sys.path]
    found = {name: read_model(folder / f"{name}.toml") for name in ("step", "filter", "mean")}
    assert sys.path == before
    assert isinstance(found["step"], NonlinearSystem)
    assert isinstance(found["filter"], NonlinearModel)
    again = NonlinearSystem(lambda fmt, x, u: (x + (u - x) * fmt.array("0.125"),) * 2, [0])
    assert np.array_equal(emulate(found["step"], Z, "Q3.12").errors, emulate(again, Z, "Q3.12").errors)
    assert found["filter"].state_names == ("x (m)", "v (m/s)")
    assert found["filter"].f is not found["filter"].h
    assert required_precision(str(folder / "mean.toml"), Z, 0.01).met
    assert required_precision({"step": found["step"].step, "x0": [0]}, Z, 0.01).met
