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
    """What is read, with a blank between elements."""
    return " ".join(html.unescape(re.sub(r"<style>.*</style>|<[^>]*>", " ", page, flags=re.DOTALL)).split())


def tables_of(page: str) -> dict[str, list[list[str]]]:
    """The cells of each table, header first, by the heading above it."""
    found = re.findall(r"<h2>([^<]*)</h2>\n<table>(.*?)</table>", page, re.DOTALL)
    return {
        heading: [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)]
        for heading, table in found
    }


def test_a_name_is_text_not_markup():
    shown = page(REPORT | {"name": "<script>alert(1)</script>", "names": ("<b>", "&", "<i>")})
    assert "<script>alert" not in shown
    assert "<b>" not in shown
    assert "<i>" not in shown  # the state that limits the answer
    assert shown.count("Wordlength for &lt;script&gt;alert(1)&lt;/script&gt;") == 2


def test_the_answer_comes_first():
    assert text_of(page(REPORT)).startswith(
        "Wordlength for tracker Wordlength for tracker This Kalman filter needs 21 bits to keep rounding errors within "
        "the tolerance. 21 bits. State 3 of 3 limits the answer: its error is 0.5 of its tolerance. "
    )
    assert "needs 21 decimal digits to" in text_of(page(REPORT | {"base": 10}))
    assert "needs no precision that can be run to" in text_of(page(REPORT | {"digits": None}))


def test_each_table_holds_what_its_heading_says():
    assert tables_of(page(REPORT)) == {
        "Basis of the answer": [
            ["question", "value"],
            ["steps", "60"],
            ["measurements", "z.csv"],
            ["tolerance", "0.01, any"],
            ["limit on the state", "10, 0.5"],
            ["limit on the measurement", "any"],
            ["rounding", "nearest"],
        ],
        "Forms and bases compared": [
            ["form and basis", "bits", "answer"],
            ["innovation, emulation", "21", "enough"],
            ["UD, bound", "none", "too few"],
        ],
        "Error / tolerance at each precision": [
            ["form and basis", "bits: error / tolerance"],
            ["innovation, emulation", "20: 10, 21: 0.4, 22: 0.2"],
            ["UD, bound", "20: 100"],
        ],
        "Error of each state at the answer": [
            ["state", "error / tolerance"],
            ["1", "0.25"],
            ["2", "not limited"],
            ["3", "0.5"],
        ],
        "Range of the numbers": [["numbers", "smallest", "largest"], ["gain", "2⁻³", "2⁵"]],
    }


def test_the_report_ends_with_how_to_reproduce_it():
    end = "How to reproduce this report python -m gpbnb.wordlength model.toml numpy: 2.0 machine: x86"
    assert text_of(page(REPORT)).endswith(end)
    assert "report gpbnb.wordlength.report.study(...) numpy" in text_of(page(REPORT | {"command": ""}))


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
