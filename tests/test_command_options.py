"""The options of every command: their defaults, what their help says, and that each changes what it says."""

from __future__ import annotations

import argparse
import importlib
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_commands import COMMANDS

from gpbnb import __main__ as top
from gpbnb.report.gravity_probe_b import horizon
from gpbnb.report.guarantees import survey
from gpbnb.report.guarantees import table as guarantees
from gpbnb.report.inversion import __main__ as inversion
from gpbnb.report.inversion import stored as stored_inversion
from gpbnb.report.kalman import ensembles
from gpbnb.report.ledger import command as ledger
from gpbnb.report.rolling import __main__ as rolling
from gpbnb.sweeps import read
from gpbnb.sweeps.sweep import Sweep
from gpbnb.wordlength import __main__ as wordlength

LIMITS = "guarantee and probable: largest size of each {} of the filter without rounding"
SWEPT = {
    "--cells": "compute only this many cells",
    "--store": "without computing more",
    "--output": "folder for the table; default: the folder for saved progress",
}
#: What each command does, and each option with its default and what it is for.
OPTIONS = {
    "report.inversion.__main__": (
        "Recompute the long sweeps",
        {
            "sweeps": (["variants", "random"], "sweeps to compute: variants, random; default: both"),
            "--folder": (".cache/inversion", "folder for the results"),
            "--first": (None, "compute only this many cells"),
            "--directory": (".cache/inversion", "folder for saved progress"),
        },
    ),
    "report.rolling.__main__": (
        "drift rates of all gyros, about 40 s of processor time",
        {"--output": (".cache/drift_rates", "folder for drift_rates.csv and saved progress")},
    ),
    "report.gravity_probe_b.year": (
        "Run the filters for a year",
        {
            "--directory": (".cache/year", "folder for saved progress"),
            "--steps": (365 * 86400 // 10, "number of steps"),
            "--cases": (45, "compute only this many cases"),
            "--output": (".cache/year", "folder for year.csv and year.json"),
        },
    ),
    "report.kalman.ensembles": (
        "random filters",
        {
            "--repeats": (34, "number of trials for each kind, format and form"),
            "--output": (".cache/ensembles", "folder for the two files"),
        },
    ),
    "report.gravity_probe_b.threshold": (
        "A year for hundreds of measurement records",
        {
            "--directory": (".cache/threshold", "folder for saved progress"),
            **{name: ({"--cells": 21, "--store": False}.get(name), words) for name, words in SWEPT.items()},
        },
    ),
    "report.gravity_probe_b.mission": (
        "A year of the mission model",
        {
            "--directory": (".cache/mission", "folder for saved progress"),
            **{name: ({"--cells": 18, "--store": False}.get(name), words) for name, words in SWEPT.items()},
        },
    ),
    "report.gravity_probe_b.horizon": (
        "error bounds for a year of Gravity Probe B",
        {
            "precision": (53, "bits of the significand"),
            "--steps": (365 * 86400 // 10, "steps of 10 s"),
            "--output": (".cache/horizon", "folder for horizon.csv"),
        },
    ),
    "report.guarantees.survey": (
        "emulated runs with their guarantees",
        {
            "--sample": (0, "number of rows to recompute and compare"),
            "--seed": (0, "which rows"),
            "--rows": (2000, "number of rows to compute"),
            "--output": (".cache/guarantee", "folder for survey.csv"),
        },
    ),
    "report.guarantees.filters": (
        "random Kalman filters with their guarantees",
        {
            "--rows": (3000, "number of filters to compute"),
            "--processes": (1, "number of processes"),
            "--output": (".cache/filters", "folder for filters.csv and saved progress"),
        },
    ),
    "report.guarantees.scalar": (
        "worst errors of scalar filters",
        {
            "--rows": (500, "number of filters to compute"),
            "--output": (".cache/scalar", "folder for scalar.csv and saved progress"),
        },
    ),
    "report.guarantees.table": (
        "table of guarantees",
        {
            "words": (None, "only the filters whose names contain one of these words; keep the other stored rows"),
            "--output": (".cache/guarantees", "folder for guarantees.csv"),
        },
    ),
    "wordlength.__main__": (
        "how many digits a filter needs",
        {
            "model": (None, "TOML file"),
            "--tolerance": (None, "largest allowed error: one number, or one per state"),
            "--measurements": (None, "CSV file with one row per step: measurements of a filter, by default simulated"),
            "--inputs": (None, "CSV file with the known inputs u"),
            "--steps": (None, "number of steps to simulate; default: 1000"),
            "--base": (2, "2, 10 or 16; default: 2"),
            "--rounding": ("nearest", 'rounding rule, such as "nearest" or "chop"'),
            "--form": (None, 'covariance update of a Kalman filter, such as "innovation", "Joseph", "UD"'),
            "--basis": (None, "how to find the precision; may be given more than once; default: emulation and bound"),
            "--state": (None, LIMITS.format("state")),
            "--innovation": (None, LIMITS.format("innovation")),
            "--measurement": (None, LIMITS.format("measurement")),
            "--report": (None, "HTML file to write, with a JSON file of the same name beside it"),
        },
    ),
    "ledger": (
        "Check every statement of the three documents",
        {
            "--format": ("csv", "default: csv"),
            "--document": (None, "hung1984, hung1982 or savage2016; default: all"),
            "--chapter": (None, "chapter number as in the document, such as II; default: all"),
            "--section": (None, "one or more section numbers; 9 includes 9.1 and 9.2; default: all"),
            "--output": (None, "file to write, replacing any existing file; default: stdout"),
            "--fresh": (False, "run every check again instead of using stored findings"),
        },
    ),
}
LISTED = {
    "wordlength": "how many digits your own filter needs",
    "ledger": "every printed equation, number and claim, with its verdict",
    "report.stored": "list the stored sweeps, or verify a sample of them",
    "report.rolling": "compute the stored drift rates again",
    "report.inversion": "compute the stored sweeps over inverses again",
    "report.gravity_probe_b.year": "compute the emulated years again",
    "report.kalman.ensembles": "compute the random filters again",
    "report.gravity_probe_b.threshold": "compute the years of hundreds of records again",
    "report.gravity_probe_b.mission": "compute the years of the mission model again",
    "report.gravity_probe_b.horizon": "compute the bounds for a year of Gravity Probe B again",
    "report.guarantees.survey": "compute the survey of guarantees again",
    "report.guarantees.filters": "compute random Kalman filters against their guarantees again",
    "report.guarantees.scalar": "compute the worst errors of scalar filters again",
    "report.guarantees.table": "compute the table of guarantees again",
}


class Parsed(Exception):
    """Raised in place of reading the arguments."""


@pytest.mark.parametrize("module", OPTIONS)
def test_each_option_has_its_default_and_its_help(module, monkeypatch):
    def parse(parser, arguments):
        raise Parsed(parser)

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    with pytest.raises(Parsed) as raised:
        importlib.import_module(f"gpbnb.{module}").main([])
    (parser,) = raised.value.args
    about, options = OPTIONS[module]
    assert parser.prog == f"python -m gpbnb.{module}".removesuffix(".__main__")
    assert about in parser.description
    _, *actions = parser._actions  # the first is --help
    assert [(action.option_strings or [action.dest])[0] for action in actions] == list(options)
    for action, (default, words) in zip(actions, options.values(), strict=True):
        assert (str(action.default) if isinstance(action.default, Path) else action.default) == default
        assert words in action.help


@pytest.mark.parametrize(
    ("command", "statuses"),
    [
        (
            wordlength,
            "Exit status: 0 if a precision meets the tolerance, 1 if none does, 2 if a file or an option is wrong.",
        ),
        (
            ledger,
            "exit status: 0, every selected entry has a finding; 1, some entries have no check; 2, the arguments are "
            "invalid, or the ledger or the output file cannot be used; 3, a check raised an exception",
        ),
    ],
)
def test_the_help_tells_the_exit_statuses(command, statuses, capsys):
    with pytest.raises(SystemExit, match="0"):
        command.main(["--help"])
    assert statuses in " ".join(capsys.readouterr().out.split())


# -- python -m gpbnb ----------------------------------------------------------------------------------------


def test_every_command_is_listed_with_what_it_does(capsys):
    assert {"gpbnb", *(f"gpbnb.{name}" for name in LISTED)} == set(COMMANDS)
    assert top.main([]) == 0
    about, _, below = capsys.readouterr().out.partition("commands:\n")
    assert "\n\nRounding errors in recursive filters, integrators and matrix computations.\n\n" in about
    listed = dict(line.split(maxsplit=1) for line in below.splitlines()[: len(LISTED)])
    assert listed.keys() == LISTED.keys()
    assert all(listed[name].startswith(LISTED[name]) for name in LISTED)


def test_a_command_gets_its_own_arguments(monkeypatch):
    ran = []
    monkeypatch.setattr(sys, "argv", ["before"])
    monkeypatch.setattr(runpy, "run_module", lambda name, run_name, **_: ran.append((name, run_name, sys.argv)))
    assert top.main(["report.gravity_probe_b.year", "--steps", "100"]) == 0
    assert ran == [("gpbnb.report.gravity_probe_b.year", "__main__", ["report.gravity_probe_b.year", "--steps", "100"])]


def test_an_unknown_command_is_told_the_known_ones(capsys):
    with pytest.raises(SystemExit):
        top.main(["bake"])
    shown = capsys.readouterr().err
    assert shown.startswith("usage: python -m gpbnb ")
    assert "got 'bake'; needed one of wordlength, ledger, report.stored, report.rolling, report.inversion" in shown


# -- what the options change --------------------------------------------------------------------------------


@pytest.fixture
def computed(monkeypatch):
    """The folders of progress, cells and files of sweeps, which are not computed."""
    asked = []
    monkeypatch.setattr(Sweep, "run", lambda self, folder, cells=None: asked.append((self.name, folder, cells)) or [])
    monkeypatch.setattr(Sweep, "store", lambda self, results, file: asked.append((self.name, file)))
    return asked


def test_drift_rates_are_written_to_the_folder_that_is_printed(computed, capsys, tmp_path):
    assert rolling.main(["--output", str(tmp_path)]) == 0
    assert computed == [("rolling/drift_rates", tmp_path, None), ("rolling/drift_rates", tmp_path / "drift_rates.csv")]
    assert capsys.readouterr().out == f"{tmp_path / 'drift_rates.csv'}\n"


def test_inverses_have_a_folder_for_results_and_one_for_progress(computed, monkeypatch, capsys, tmp_path):
    loaded = SimpleNamespace(records=lambda: [{"trials": "5"}, {"trials": "17"}])
    monkeypatch.setattr(Sweep, "load", lambda self, file: loaded)
    results, progress = tmp_path / "results", tmp_path / "progress"
    given = ["random", "--folder", str(results), "--directory", str(progress), "--first", "3"]
    assert inversion.main(given) == 0
    cells = stored_inversion.sweep("random").cells()[:3]
    assert computed == [("inversion/random", progress / "random", cells), ("inversion/random", results / "random.csv")]
    assert capsys.readouterr().out == f"{results / 'random.csv'}: 17 inversions\n"


def test_a_sample_of_the_survey_has_its_size_and_its_seed(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(survey, "sample", lambda count, seed: asked.append((count, seed)) or [("old", "new")])
    assert survey.main(["--sample", "3", "--seed", "7"]) == 1
    assert capsys.readouterr().out == "stored old, recomputed new\n"
    monkeypatch.setattr(survey, "sample", lambda count, seed: asked.append((count, seed)) or [])
    assert survey.main(["--sample", "4"]) == 0
    assert asked == [(3, 7), (4, 0)]


def test_the_survey_has_as_many_rows_as_asked_for(monkeypatch, tmp_path):
    row = survey.load()[0]
    monkeypatch.setattr(survey, "compute", lambda seed: row._replace(seed=seed))
    assert survey.main(["--rows", "3", "--output", str(tmp_path / "new")]) == 0
    assert survey.load(tmp_path / "new" / "survey.csv") == tuple(row._replace(seed=seed) for seed in range(3))


def test_words_choose_the_guarantees_that_are_computed_again(monkeypatch, capsys, tmp_path):
    stored = guarantees.load()
    monkeypatch.setattr(guarantees, "_found", lambda *_: None)
    monkeypatch.setattr(
        guarantees,
        "compute",
        lambda case: next(row for row in stored if row.name == case.make().name)._replace(seconds="77"),
    )
    assert guarantees.main(["Dyer", "--output", str(tmp_path)]) == 0
    found = guarantees.load(tmp_path / "guarantees.csv")
    assert [row.name for row in found if row.seconds == "77"] == ["Dyer and McReynolds"]
    assert [row for row in found if row.seconds != "77"] == [row for row in stored if "Dyer" not in row.name]
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == 1
    assert printed[0].startswith("Dyer and McReynolds ")


def test_the_horizon_is_written_for_absolute_states_and_then_for_deviations(monkeypatch, tmp_path):
    absolute, deviation = (horizon.Bounds(size * np.ones(10), np.ones(10), np.ones((10, 4))) for size in (5, 2))
    monkeypatch.setattr(horizon, "gravity_probe_b_bounds", lambda *_: [(3, [absolute, deviation])])
    assert horizon.main(["24", "--steps", "3", "--output", str(tmp_path)]) == 0
    rows = read(tmp_path / "horizon.csv", horizon.COLUMNS, "").rows
    assert [row[:4] for row in rows] == [("24", "3", "absolute", "5"), ("24", "3", "deviation", "2")]


def test_ensembles_say_how_they_were_made(monkeypatch, tmp_path):
    monkeypatch.setattr(ensembles, "KINDS", ensembles.KINDS[:1])
    monkeypatch.setattr(ensembles, "FORMATS", ensembles.FORMATS[:1])
    monkeypatch.setattr(ensembles, "sweep", lambda todo, progress: ())
    monkeypatch.setattr(ensembles, "lines", lambda seed, outcomes: [])
    assert ensembles.main(["--repeats", "3", "--output", str(tmp_path)]) == 0
    made = ensembles.provenance(tmp_path)
    assert made["command"] == "python -m gpbnb.report.kalman.ensembles"
    assert made["formats"] == [str(ensembles.FORMATS[0])]
    assert made["trials"] == len(ensembles.tasks(3))
    assert made["steps"] == ensembles.tasks(1)[0].steps
