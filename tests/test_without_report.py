"""The library works without the packages of the report, and a report without them says what to install."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from gpbnb.report import PACKAGES

ROOT = Path(__file__).resolve().parents[1]
WITHOUT = f"import sys\nfor name in {PACKAGES}: sys.modules[name] = None\n"
MODEL = """name = "Nile, annual flow"
Phi = [[1]]
H = [[1]]
Q = [[1469.1]]
R = [[15099]]
x0 = [1000]
P0 = [[1e7]]
"""
LIBRARY = """
import numpy as np
from gpbnb import FloatFormat, LinearModel, LinearSystem, NAMED_FORMATS, read_model, required_precision, survey_records
import gpbnb
from gpbnb.bounds.guarantee import guarantee, limits
assert all(hasattr(gpbnb, name) for name in gpbnb.__all__)
model = read_model("nile.toml")
print(required_precision(model, 50, 1.0).digits)
z = np.round(np.random.default_rng(1).standard_normal((3, 20, 1)) * 100)
print(len(survey_records(model, z, 1.0, [FloatFormat(2, 24)]).ratios))
within = limits(innovation=1000.0, state=2000.0)
print(guarantee(model, FloatFormat(2, 24), within).for_ever)
print(required_precision(model, 20, 1.0, basis="probable", within=within).digits)
for structure in ("balanced state space", "cascade of direct form II"):
    scale = structure.startswith("cascade")
    system = LinearSystem.from_sections([[1, 2, 1, 1, -1, 0.5], [1, 2, 1, 1, -1, 0.25]], structure, scale=scale)
    print(required_precision(system, np.ones((20, 1)), 0.01).digits)
"""
COMMAND = "import runpy\nsys.argv = ['gpbnb', *{}]\nrunpy.run_module('gpbnb', run_name='__main__')\n"


def run(code, folder):
    return subprocess.run([sys.executable, "-c", WITHOUT + code], cwd=folder, capture_output=True, text=True)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "nile.toml").write_text(MODEL, encoding="utf-8")
    return tmp_path


def test_the_extra_has_the_packages_that_are_looked_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert tuple(Requirement(text).name for text in project["optional-dependencies"]["report"]) == PACKAGES
    assert not {Requirement(text).name for text in project["dependencies"]} & set(PACKAGES)


def test_the_library_answers_without_them(folder):
    done = run(LIBRARY, folder)
    assert done.returncode == 0, done.stderr
    precision, records, for_ever, probable, *structures = done.stdout.split()
    assert 5 < int(precision) < 30
    assert (records, for_ever) == ("3", "True")
    assert 5 < int(probable) < 30
    assert all(5 < int(each) < 30 for each in structures)


def test_a_command_of_the_report_says_in_one_line_what_to_install(folder):
    done = run(COMMAND.format(["ledger"]), folder)
    assert done.returncode == 2
    assert done.stderr == (
        "gpbnb.report: got no joblib, matplotlib, scipy, sympy; needed joblib, matplotlib, scipy, "
        "sympy; install them: pip install 'gpbnb[report]'\n"
    )


def test_an_import_of_the_report_says_what_to_install(folder):
    done = run("from gpbnb.report.rounding import experiment", folder)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        "ImportError: gpbnb.report: got no joblib, matplotlib, scipy, sympy; needed"
    )
