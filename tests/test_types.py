"""Both type checkers accept what README, docstrings and book show, and refuse what the package refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from examples import ROOT, examples

USER = """
import numpy as np
from fractions import Fraction
from gpbnb import (
    BINARY32, FixedFormat, FloatFormat, Form, LinearModel, LinearSystem, emulate, guarantee, limits, linalg, read_model,
    required_precision, survey_records,
)

fmt = FloatFormat(base=10, precision=8, rounding="chop")
x, y = fmt.array(["0.1", "2.5", "-3"]), fmt.array(["7", "1e-3", "0.2"])
print(float(linalg.dot(x, y)), np.sqrt(x * x) @ x.T, 2 * x + y, np.stack([x, y]) @ x, np.where(x > 0, x, y))
cart = LinearModel(
    Phi=[[1, "0.1"], [0, 1]], H=[[1, 0]], Q=[["1e-6", 0], [0, "1e-4"]], R=[["0.04"]], x0=[0, 0], P0=np.eye(2),
    B=lambda k: [["0.005"], ["0.1"]], u=[[1], [1], [0]], d=[Fraction(1, 2)], state_names=["position (m)", "speed"],
)
answer = required_precision(cart, 3, [0.01, np.inf], rounding="chop", form="UD", basis="bound")
print(FloatFormat(2, answer.precision + 2).unit_roundoff, answer.fmt.largest)
system = LinearSystem([["0.9"]], [["0.1"]], name="smoother", input_names=("u",))
print(required_precision(system, 4, 0.01, z=[[1], [2], [3], [4]]), required_precision("model.toml", 4, 0.01))
walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
print(guarantee(walk, BINARY32, limits(1, 1, 10, 5), form="UD").bound)
print(emulate(walk, np.ones((3, 1)), BINARY32, Form.UD))
print(survey_records(walk, 3, 0.01, [FloatFormat(2, 4), BINARY32], steps=20).shares)
print(read_model({"A": [[1]], "B": [[1]]}))
print(FixedFormat(0, 15, "floor", "saturate").zeros((2, 2)).to_bits(), BINARY32.from_bits([0, 1]).to_float())
"""
# What no checker may accept: each line is an error.
WRONG = """
from gpbnb import FloatFormat, LinearModel, required_precision
FloatFormat("2", 8)
LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1j]])
LinearModel(None, [[1]], [[1]], [[1]], [0], [[1]])
required_precision({"A": [[1]], "B": [[1]]}, 3, 0.1, basis="certainty")
required_precision(7, 3, 0.1)
"""
MYPY = """
[mypy]
ignore_missing_imports = true
allow_redefinition_new = true
local_partial_types = true
"""


def mypy(folder: Path) -> list[str]:
    """Errors as "file:line"."""
    (folder / "mypy.ini").write_text(MYPY)
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--config-file",
        str(folder / "mypy.ini"),
        "--output",
        "json",
        "--cache-dir",
    ]
    done = subprocess.run(
        [*command, str(ROOT / ".cache" / "mypy-examples"), str(folder)], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return [
        f"{Path(each['file']).name}:{each['line']}: {each['message']}" for each in found if each["severity"] == "error"
    ]


def pyright(folder: Path) -> list[str]:
    pytest.importorskip("basedpyright", reason="it is in environment.txt; make installs it")
    (folder / "pyrightconfig.json").write_text(
        json.dumps({"typeCheckingMode": "standard", "extraPaths": [str(ROOT)], "reportMissingModuleSource": False})
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "basedpyright",
            "--outputjson",
            "--pythonpath",
            sys.executable,
            "--project",
            str(folder),
        ],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = json.loads(done.stdout)["generalDiagnostics"]
    return [
        f"{Path(each['file']).name}:{each['range']['start']['line'] + 1}: {each['message']}"
        for each in found
        if each["severity"] == "error"
    ]


@pytest.mark.parametrize("checker", [mypy, pyright])
def test_checkers_accept_every_example_and_refuse_what_the_package_refuses(checker, tmp_path):
    """Both in one run of a checker, which reads the package and NumPy first."""
    found = {**examples(), "user": USER}
    assert {"readme", "user", "book_kalman", "docs_filters_model"} <= found.keys()
    for name, code in {**found, "wrong": WRONG}.items():
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")
    errors = checker(tmp_path)
    assert [each for each in errors if not each.startswith("wrong.py:")] == []
    lines = {int(each.split(":")[1]) for each in errors if each.startswith("wrong.py:")}
    assert lines == set(range(3, 3 + WRONG.count("\n") - 2))
