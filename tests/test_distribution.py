"""How the tests are shared among processes: the functions of the conftest.py at the root."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def root(pytestconfig):
    plugins = pytestconfig.pluginmanager.get_plugins()
    return next(each for each in plugins if getattr(each, "__file__", None) == str(ROOT / "conftest.py"))


@pytest.mark.parametrize(
    ("nodeid", "group"),
    [
        ("tests/rounding/test_rounding_theory.py::test_a[1]", "tests/rounding/test_rounding_theory.py"),
        ("book/kalman.ipynb::Cell 3", "book/kalman.ipynb"),
        ("tests/ledger/test_alterations.py::test_a[hung1984.II.eq8]", "alterations of hung1984.II"),
        ("tests/ledger/test_alterations.py::test_a", "tests/ledger/test_alterations.py"),
        ("tests/pages/test_pages.py::test_a[book/story.html-phone]", "book/story.html"),
        ("tests/pages/test_pages.py::test_a[book/story.html-paper]", "book/story.html"),
        ("tests/pages/test_pages.py::test_a[dark]", "test_a"),
        ("tests/pages/test_calculators.py::test_b[kalman]", "tests/pages/test_calculators.py"),
        ("tests/pages/test_ledger_page.py::test_a[True]", "tests/pages/test_ledger_page.py"),
    ],
)
def test_one_process_runs_what_shares_something(root, nodeid, group):
    assert root.group(nodeid) == group


def test_what_takes_longest_is_there(root):
    files = [each for each in root.LONGEST if not each.startswith("alterations")]
    assert [each for each in files if not (ROOT / each).is_file()] == []


def test_the_longest_files_come_first(root, request):
    names = [root.group(item.nodeid) for item in request.session.items]
    longest = [name for name in names if name in root.LONGEST]
    assert names[: len(longest)] == longest == sorted(longest, key=root.LONGEST.index)


@pytest.mark.parametrize(
    ("given", "shared"),
    [
        ({"nbval": True}, True),
        ({"nbval": False}, False),
        ({"nbval": True, "usepdb": True}, False),
        ({"nbval": True, "numprocesses": 0}, False),
        ({"nbval": True, "numprocesses": 3}, False),
    ],
)
def test_notebooks_are_shared_among_the_processors_unless_told_how(root, given, shared):
    option = SimpleNamespace(**{"numprocesses": None, "dist": "no", "usepdb": False} | given)
    root.pytest_cmdline_main(SimpleNamespace(option=option))
    assert (option.dist == "loadgroup") is shared
    assert (option.numprocesses == min(os.cpu_count(), root.MOST_PROCESSES)) is shared


def test_a_process_that_shares_notebooks_does_not_share_them_again(root):
    option = SimpleNamespace(nbval=True, numprocesses=None, dist="no", usepdb=False)
    root.pytest_cmdline_main(SimpleNamespace(option=option, workerinput={}))
    assert option.numprocesses is None


def test_without_plugins_nothing_is_shared(root):
    root.pytest_cmdline_main(SimpleNamespace(option=SimpleNamespace(usepdb=False)))
