"""Checks are read and run: what is wrong with one names its statement."""

import re

import pytest

from gpbnb.report.ledger import examine, load_statements, select
from gpbnb.report.ledger.checking import TOPICS
from gpbnb.report.ledger.judge import read

EMPTY = dict.fromkeys(("domain", "mode", "also", "verdict", "root", "recomputed", "note", "otherwise"), "")


def test_an_error_names_the_statement_whose_check_raised_it(monkeypatch):
    monkeypatch.setattr(TOPICS["kalman"], "run", lambda statement: 1 / 0)
    with pytest.raises(ZeroDivisionError) as raised:
        examine(select(load_statements(), "hung1984", "II", "12"))
    assert re.fullmatch(r"in the check of hung1984\.II\..+", *raised.value.__notes__)


def test_two_rows_of_a_statement_are_refused(monkeypatch):
    rows = [{"statements": key, **EMPTY} for key in ("*.eq1", "hung1984.II.eq1")]
    monkeypatch.setattr("gpbnb.report.ledger.judge.rows_of", lambda name: iter(rows))
    with pytest.raises(ValueError, match=r"two rows of 'hung1984\.II\.eq1' in topic\.csv; needed one"):
        read("some.topic", {})
