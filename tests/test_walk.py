"""The walk that CONTRIBUTING tells is the one that a question about a filter takes through the files."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gpbnb
from gpbnb import limits, required_precision
from gpbnb.filters.recording import recorded_step
from gpbnb.wordlength.examples import tracker

ROOT = Path(gpbnb.__file__).parent


def crossed(call):
    """Files of the package in which a call runs functions."""
    seen = set()

    def note(frame, event, _):
        if event == "call":
            seen.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return {Path(name).relative_to(ROOT).as_posix() for name in seen if name.startswith(f"{ROOT}/")}


def test_a_question_crosses_the_files_that_the_guide_names():
    text = (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    walk = text.partition("### A question about a filter")[2].partition("### ")[0]
    named = set(re.findall(r"`([\w/]+\.py)`", walk))
    within = limits(2, 1, state=[1000, 30], innovation=8)
    recorded_step.cache_clear()  # a step that another test recorded is not recorded again
    seen = [
        crossed(lambda basis=basis, given=given: required_precision(tracker(), 100, 0.01, basis=basis, within=given))
        for basis, given in (("emulation", None), ("bound", None), ("guarantee", within))
    ]
    assert len(named) > 10
    assert named - set.union(*seen) == set()
