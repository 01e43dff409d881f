"""gpbnb.wordlength.report: what the page says beside each number."""

from __future__ import annotations

import html
import re

import numpy as np
import pytest

from gpbnb import FixedFormat
from gpbnb.filters.model import LinearModel
from gpbnb.filters.poles import stored_response
from gpbnb.wordlength.models import FilterSource, read_filter
from gpbnb.wordlength.report import Question, page, study

REPORT = {
    "name": "tracker",
    "kind": "Kalman filter",
    "digits": 21,
    "text": "21 bits",
    "base": 2,
    "rounding": "nearest",
    "steps": 60,
    "tolerance": (0.01, None),
    "source": "z.csv",
    "answers": [
        {
            "label": "innovation, emulation",
            "basis": "emulation",
            "digits": 21,
            "text": "enough",
            "tried": ((20, 10.0), (21, 0.4), (22, 0.2)),
        },
        {"label": "UD, bound", "basis": "bound", "digits": None, "text": "too few", "tried": ((20, 100.0),)},
    ],
    "errors": (0.25, None, 0.5),
    "limiting": 2,
    "ranges": (("gain", -3, 5),),
    "command": "python -m gpbnb.wordlength model.toml",
    "versions": {"numpy": "2.0", "machine": "x86"},
    "limits": {"state": (10.0, 0.5), "measurement": (None,)},
    "met": True,
    "fixed": False,
} | dict.fromkeys(
    ("format", "exponents", "structure", "stored", "shortest", "names", "measurement_names", "blocks"), ""
)
REPORT["lacking"] = {}
MODEL = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])


def text_of(page: str) -> str:
    """What is read, a line for each paragraph and row, with bars between cells; markup that no one escaped is lost."""
    body = re.sub(r"<style>.*</style>", "", page, flags=re.DOTALL)
    plain = re.sub(r"<[^>]*>", "", re.sub(r"</t[hd]>(?=<t)", " | ", body))
    return "\n".join(line for line in html.unescape(plain).split("\n") if line)


FULL = REPORT | {
    "name": "<script>alert(1)</script>",
    "text": "21 bits <i>",
    "fixed": True,
    "names": ("angle <rad>", "bias & drift", "<i>"),
    "measurement_names": ("gyro",),
    "tolerance": (0.01, None, 2.0),
    "limits": {"state": (10.0, 0.5, None), "measurement": (2.0,)},
    "source": "<i>.csv",
    "command": "gpbnb <i>",
    "exponents": "-14 to 15",
    "blocks": (("gain <K>", 9, 8), ("state", 20, None)),
    "lacking": {"lattice": "a pole <i> is > 1"},
    "stored": "coefficients <i>",
    "shortest": "fewest digits: <UD>",
}
TEXT = """
Wordlength for <script>alert(1)</script>
Wordlength for <script>alert(1)</script>
This Kalman filter needs 21 fraction bits to keep rounding errors within the tolerance.
21 bits <i>.
Fewest digits: <UD>.
At this answer, coefficients <i>.
State <i> limits the answer: its error is 0.5 of its tolerance.
Basis of the answer
question | value
steps | 60
measurements | <i>.csv
tolerance | angle <rad>: 0.01, bias & drift: any, <i>: 2
limit on the state | angle <rad>: 10, bias & drift: 0.5, <i>: any
limit on the measurement | gyro: 2
rounding | nearest
exponents | -14 to 15
An emulation holds for these measurements. A bound holds for the arithmetic of this run, whatever its roundings.
Forms and bases compared
form and basis | fraction bits | answer
innovation, emulation | 21 | enough
UD, bound | none | too few
Left out: lattice: a pole <i> is > 1.
Error / tolerance at each precision
form and basis | fraction bits: error / tolerance
innovation, emulation | 20: 10, 21: 0.4, 22: 0.2
UD, bound | 20: 100
Precision of each block
block of the filter | fraction bits, with the others | fraction bits, alone
gain <K> | 9 | 8
state | 20 | none
Error of each state at the answer
state | error / tolerance
angle <rad> | 0.25
bias & drift | not limited
<i> | 0.5
Range of the numbers
numbers | smallest | largest
gain | 2⁻³ | 2⁵
How to reproduce this report
gpbnb <i>
numpy: 2.0
machine: x86
"""


def test_a_page_says_all_of_its_report():
    assert text_of(page(FULL)) == TEXT.strip()


@pytest.mark.parametrize(
    ("change", "lines"),
    [
        (
            {},
            ["State 3 of 3 limits the answer: its error is 0.5 of its tolerance.", "tolerance | 0.01, any", "1 | 0.25"],
        ),
        ({}, ["limit on the state | 10, 0.5", "form and basis | bits | answer", "21 bits."]),
        ({"base": 10}, ["This Kalman filter needs 21 decimal digits to keep rounding errors within the tolerance."]),
        (
            {"digits": None},
            ["This Kalman filter needs no precision that can be run to keep rounding errors within the tolerance."],
        ),
        ({"format": "<Q>"}, ["This Kalman filter keeps rounding errors within the tolerance in <Q>."]),
        (
            {"format": "Q", "met": False},
            ["This Kalman filter does not keep rounding errors within the tolerance in Q."],
        ),
        (
            {"format": "Q", "met": False, "answers": REPORT["answers"][1:]},
            ["This Kalman filter is not proved to keep rounding errors within the tolerance in Q."],
        ),
        (
            {"kind": "linear system"},
            ["inputs | z.csv", "Structures and bases compared", "structure and basis | bits | answer"],
        ),
        ({"command": ""}, ["gpbnb.wordlength.report.study(...)"]),
        ({"limiting": None}, ["21 bits.\nBasis of the answer"]),
    ],
)
def test_a_page_says_what_differs(change, lines):
    text = f"\n{text_of(page(REPORT | change))}\n"
    assert [line for line in lines if f"\n{line}\n" not in text] == []


@pytest.mark.parametrize(
    ("given", "source"),
    [
        ({"steps": 5}, "simulated by the model, seed 0"),
        ({"z": [[1], [2]]}, "given"),
        ({"steps": 5, "source": "a"}, "a"),
    ],
)
def test_a_study_says_where_its_measurements_come_from(given, source):
    told: list[str] = []
    asked = {name: value for name, value in given.items() if name != "source"}
    question = Question(FilterSource(MODEL), 0.1, bases=("emulation",), **asked)
    found = study(question, given.get("source", ""), tell=told.append)
    told_first = [found.entries[each] for each in ("kind", "source", "steps")]
    assert told_first == ["Kalman filter", source, given.get("steps", 2)]
    assert [each["label"] for each in found.entries["answers"]] == [
        "innovation, emulation",
        "Joseph, emulation",
        "UD, emulation",
    ]
    assert told[:2] == ["innovation, emulation …", f"innovation, emulation: {found.answer}"]


@pytest.mark.parametrize(
    ("asked", "stored", "shortest"),
    [
        ({}, "{} bits", "fewest digits: balanced state space, 9 bits"),
        ({"kind": "fixed"}, "15 significant bits", "shortest: balanced state space, word of 10 bits"),
        ({"kind": "fixed", "fmt": FixedFormat(2, 12)}, "15-bit fixed point (12 fraction bits)", ""),
        ({"kind": "words"}, "9 significant bits", ""),  # another structure has as many bits
    ],
)
def test_what_storing_does_to_a_filter_is_told_with_the_format_of_its_coefficients(asked, stored, shortest):
    source = read_filter({"b": ["0.1", "0.2", "0.1"], "a": [1, "-1.2", "0.5"], "structure": "direct form I"})
    question = Question(source, "0.01", z=np.sin(np.arange(60) / 3)[:, None], bases=("emulation",), **asked)
    found = study(question)
    change = stored_response(source.model, found.answer.format)._replace(format=stored.format(found.answer.digits))
    assert found.entries["stored"] == str(change)
    assert found.entries["shortest"].partition(" (structure")[0] == shortest


def test_the_state_with_the_largest_share_of_its_tolerance_limits():
    model = LinearModel([[1, "0.1"], [0, 1]], [[1, 0]], np.eye(2) / 64, [[1]], [0, 0], np.eye(2))
    entries = study(Question(FilterSource(model), (1, "1/1000"), bases=("emulation",), steps=5)).entries
    assert entries["errors"][0] < entries["errors"][1]
    assert entries["limiting"] == 1
