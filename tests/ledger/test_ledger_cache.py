"""Findings are kept between runs until something changes that they depend on."""

from __future__ import annotations

import math
import os
import shutil
from dataclasses import replace

import pytest
from forks import answering

from gpbnb import caching
from gpbnb.report import ledger
from gpbnb.report.ledger import cache, checking
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.statements import load_statements

# Loads the libraries once. For each line of input, a process of its own loads the package as it is then, examines the
# entries that the line names, and says which checks were run.
PROGRAM = """
import json, os, sys
import flint, gmpy2, mpmath, numba, numpy, sympy, sympy.combinatorics.polyhedron, sympy.tensor.tensor, tqdm

def answer(line):
    from gpbnb.report.ledger import checking
    from gpbnb.report.ledger.statements import load_statements

    ran, examine = [], checking.examine

    def noted(statements, *others):
        statements = tuple(statements)
        ran.extend(each.id for each in statements)
        return examine(statements, *others)

    checking.examine = noted
    rows = checking.examine_once([each for each in load_statements() if each.id in line.split()])
    print(json.dumps({"ran": ran, "outcomes": {row.statement.id: row.outcome for row in rows}}), flush=True)
"""
# One statement each of three topics. All of them rest on the compiled kernels, which round numbers to printed digits.
GEOMETRY, INTEGRATION, ROUNDING = "hung1982.IV.eq1", "savage2016.main.eq7", "hung1984.II.eq8"
SAMPLE = (GEOMETRY, INTEGRATION, ROUNDING)
TWO = [each for each in load_statements() if each.id in SAMPLE]


@pytest.fixture
def copy(tmp_path):
    """A copy of the package; `copy(*ids)` examines entries in a new process and says which checks were run."""
    package = tmp_path / "gpbnb"
    shutil.copytree(caching.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "GPBNB_CACHE_DIR": str(tmp_path / "cache")}
    with answering(PROGRAM, cwd=tmp_path, env=environment) as ask:

        def run(*ids: str) -> dict:
            return ask(" ".join(ids))

        run.package = package
        yield run


def append(path, text: str) -> None:
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def test_exactly_the_checks_that_depend_on_a_change_have_another_file(tmp_path, monkeypatch):
    """Findings are kept in a file for each module of checks, whose name changes with all that they depend on."""
    package = tmp_path / "gpbnb"
    shutil.copytree(caching.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    modules = {each.id: package / checking._module(each, TOPICS).relative_to(caching.PACKAGE) for each in TWO}
    monkeypatch.setattr(caching, "PACKAGE", package)
    monkeypatch.setattr(caching, "_IMPORTED", math.inf)
    monkeypatch.setattr(cache, "_folder", lambda: tmp_path)

    def files():
        caching.forget()
        for each in (cache._file, caching._named):
            each.cache_clear()
        return {key: cache._file(module) for key, module in modules.items()}

    def changed_by(*parts):
        before, file = files(), package.joinpath(*parts)
        append(file, "# changed\n") if file.exists() else file.write_text("1\n")
        after = files()
        return {key for key in modules if before[key] != after[key]}

    try:
        # The page that shows findings and the other topics change nothing.
        assert changed_by("report", "ledger", "page.py") == changed_by("report", "rolling", "theory.py") == set()
        assert changed_by("arithmetic", "kernels", "binary.py") == set(SAMPLE)
        assert changed_by("report", "integration", "theory.py") == {INTEGRATION}
        assert changed_by("report", "geometry", "derivation.py") == {GEOMETRY}
        assert changed_by("report", "rounding", "stored.csv") == {ROUNDING}  # data beside the sources
    finally:
        monkeypatch.undo()
        files()


def test_checks_whose_file_is_another_are_run_again_and_no_others(copy):
    first = copy(*SAMPLE)
    assert sorted(first["ran"]) == sorted(SAMPLE)
    append(copy.package / "report" / "ledger" / "page.py", "# changed\n")
    assert copy(*SAMPLE) == {"ran": [], "outcomes": first["outcomes"]}
    append(copy.package / "report" / "integration" / "theory.py", "# changed\n")
    key = "savage2016.main.stitle.date"  # a finding that is data follows its file
    assert copy(*SAMPLE, key) == {"ran": [key, INTEGRATION], "outcomes": first["outcomes"] | {key: "given"}}
    file = copy.package / "report" / "ledger" / "unjudged.csv"
    file.write_text(
        file.read_text(encoding="utf-8").replace(f"{key},integration,given", f"{key},integration,unverifiable")
    )
    append(copy.package / "report" / "ledger" / "unjudged.py", "# changed\n")
    assert copy(key) == {"ran": [key], "outcomes": {key: "unverifiable"}}
    assert copy(key)["ran"] == []


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "_folder", lambda: tmp_path)
    cache._file.cache_clear()
    yield tmp_path
    cache._file.cache_clear()


@pytest.fixture
def ran(monkeypatch):
    """Ids of the statements whose checks were run."""
    found, examine = [], checking.examine

    def noted(statements, *others):
        statements = tuple(statements)
        found.extend(each.id for each in statements)
        return examine(statements, *others)

    monkeypatch.setattr(checking, "examine", noted)
    return found


def test_findings_come_back_as_they_were(folder, ran):
    fresh = ledger.examine(TWO)
    assert checking.examine_once(TWO) == checking.examine_once(TWO) == fresh
    assert sorted(ran) == sorted(each.id for each in TWO)
    assert len(list(folder.glob("*.json"))) == 3
    assert not list(folder.glob("*.lock"))


def test_an_altered_statement_has_its_own_finding(folder, ran):
    (original,) = [each for each in TWO if each.id == ROUNDING]
    altered = replace(original, text=original.text + " And more.")
    checking.examine_once([original])
    checking.examine_once([altered])
    assert ran == [ROUNDING, ROUNDING]
    checking.examine_once([original, altered])
    assert ran == [ROUNDING, ROUNDING]


@pytest.mark.parametrize("damage", [lambda whole: whole[:50], lambda whole: whole.replace(b"o", b"0")])
def test_a_damaged_file_is_written_anew(folder, ran, damage):
    before = checking.examine_once(TWO)
    for path in folder.glob("*.json"):
        path.write_bytes(damage(path.read_bytes()))
    assert checking.examine_once(TWO) == before
    assert len(ran) == 6
    assert checking.examine_once(TWO) == before
    assert len(ran) == 6


def test_a_process_whose_sources_were_changed_behind_its_back_keeps_nothing(folder, ran, monkeypatch):
    monkeypatch.setattr(caching, "_IMPORTED", 0.0)
    checking.examine_once(TWO)
    checking.examine_once(TWO)
    assert len(ran) == 6
    assert not list(folder.glob("*.json"))


def test_a_file_is_written_for_new_findings_only(tmp_path):
    (row,) = ledger.examine(TWO[:1])
    findings = cache.Findings(tmp_path / "findings.json")
    findings.save()
    assert not list(tmp_path.iterdir())
    for each in (cache.Findings(None), findings):
        each.put(row.statement, row.finding)
        each.save()
    assert [path.name for path in tmp_path.iterdir()] == ["findings.json"]


def test_an_error_is_not_kept(folder, ran, topic):
    name = topic("broken", "@CHECKS.add('hung1984.II.eq8')\ndef fails():\n    raise RuntimeError('once')\n")
    checks = {"broken": __import__(name).CHECKS}
    chosen = [each for each in TWO if each.id == ROUNDING]
    for _ in range(2):
        (row,) = checking.examine_once(chosen, checks)
        assert row.outcome == "failed"
    assert ran == [ROUNDING, ROUNDING]


def test_every_check_of_the_package_can_be_kept():
    for statement in load_statements():
        if any(statement.id in checks for checks in TOPICS.values()):
            assert checking._module(statement, TOPICS) is not None, statement.id
