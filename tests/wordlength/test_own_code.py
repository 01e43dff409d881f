"""Functions that a model file names by path: every question works, and a wrong one ends in one line."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest

from gpbnb import NonlinearModel, NonlinearSystem, emulate, read_model, required_precision
from gpbnb.wordlength.__main__ import main

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


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("step", ["--measurements", "z.csv", "--kind", "fixed"]),
        ("step", ["--simulate", "step", "--steps", "9"]),
        ("step", ["--measurements", "z.csv", "--format", "float32", "--code", "code_of_step"]),
        ("filter", ["--measurements", "z.csv", "--code", "code_of_filter"]),
        ("filter", ["--steps", "9", "--form", "UD"]),
        ("filter", ["--steps", "9", "--kind", "blocks"]),
        ("mean", ["--measurements", "z.csv"]),
    ],
)
def test_the_command_answers_and_writes_what_it_can(folder, monkeypatch, capsys, name, given):
    monkeypatch.chdir(folder)
    assert main([f"{name}.toml", "--tolerance", "0.01", *given, "--report", "r.html", "--csv", "run.csv"]) == 0
    answer = json.loads((folder / "r.json").read_text())
    assert capsys.readouterr().out.startswith(answer["text"])
    rows = (folder / "run.csv").read_text().splitlines()
    assert len(rows) == 2 + (1 if name == "mean" else answer["steps"])
    assert answer["kind"] in (folder / "r.html").read_text()


def test_a_function_without_data_takes_its_number_of_steps(folder, capsys):
    (folder / "mean.toml").write_text('function = "code/own.py:powers"\n')
    assert main([str(folder / "mean.toml"), "--tolerance", "0.01", "--steps", "5"]) == 0
    assert "observed in 5 steps" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("return x + gain * u, x", "line 3 of wrong.py raised NameError: name 'gain' is not defined"),
        ("raise ValueError('my own\\nreason')", "line 3 of wrong.py raised ValueError: my own reason"),
        ("return x + float(x[0]), x", r"line 3 of wrong.py raised TypeError: got float\(\) of a FloatArray"),
        ("return x", "got a FloatArray from the step; needed two, the next state and the output"),
    ],
)
def test_what_the_users_code_raises_is_one_line_with_its_place(folder, capsys, line, message):
    (folder / "wrong.py").write_text(f"\ndef step(fmt, x, u):\n    {line}\n")
    (folder / "step.toml").write_text('step = "wrong.py:step"\nx0 = [0]\n')
    assert main([str(folder / "step.toml"), "--tolerance", "1", "--simulate", "step", "--quiet"]) == 2
    said = capsys.readouterr()
    assert not said.out
    assert said.err.count("\n") == 1
    assert re.match(f"python -m gpbnb.wordlength: {message}", said.err)
