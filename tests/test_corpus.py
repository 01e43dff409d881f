"""A part of the golden corpus, and that its command finds what differs."""

from __future__ import annotations

import pytest

from tests.corpus import __main__ as corpus
from tests.corpus import package
from tests.corpus.families import FAMILIES

pytestmark = pytest.mark.usefixtures("loops_at_once")
STORED = corpus.stored()
SLOW = ("long kalman", "extended", "elements", "matrices", "code")
"""Families of which a fifth runs here, and all in ``python -m tests.corpus``."""
TWO_WORDS = ("matrices 10", "matrices 30", "matrices 50")
"""Products and elimination in loops of two words, which take seven seconds to compile."""
SOME = [
    name for i, name in enumerate(corpus.names()) if name not in TWO_WORDS and (i % 5 == 3 or not name.startswith(SLOW))
]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_digits_of_runs_are_those_that_were_stored(family):
    for name in (each for each in SOME if each.rpartition(" ")[0] == family):
        assert corpus.difference(corpus.row(name), STORED[name]) == "", name


def test_every_run_is_stored():
    assert list(STORED) == corpus.names()


def test_a_changed_quantity_is_found_after_the_last_checkpoint_that_agrees(monkeypatch):
    """The 11th step of this run has another number than it had."""
    name = "functions 1"
    steps = package.stepped

    def changed(*arguments):
        for k, step in enumerate(steps(*arguments), start=1):
            yield {"x": [*step["x"][:-1], step["x"][-1] + 1]} if k == 11 else step

    monkeypatch.setattr(package, "stepped", changed)
    assert corpus.difference(corpus.row(name), STORED[name]) == "differs after step 8, up to step 16"


def test_a_bound_within_its_tolerance_is_the_same():
    assert corpus.near("bound 1.01; ratio 2", "bound 1; ratio 2") == ""
    assert corpus.near("bound 1.03", "bound 1") == "has a bound 1.03, stored 1"
    assert corpus.near("ratio 2.0001", "ratio 2") == "has a ratio 2.0001, stored 2"
    assert corpus.near("ratio 2; ratio 3", "ratio 2") == "has 2 values, stored 1"
