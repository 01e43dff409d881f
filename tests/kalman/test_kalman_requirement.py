"""gpbnb.wordlength.requirement: an answer in words."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.wordlength.requirement import Requirement, listed

FOUND = Requirement(FloatFormat(10, 9, "chop"), "bound", 60, ((8, 2.0), (9, 0.4567), (10, 0.04)))
NONE = Requirement(None, "emulation", 60, ((52, 3.0), (53, 2.0)))


def test_an_answer_says_its_format_its_error_and_its_basis():
    assert str(FOUND) == "9 digits of base 10, chop: 0.46 of the tolerance (bound, 60 steps)"
    assert str(NONE) == "no precision up to 53 digits meets the tolerance (emulation, 60 steps)"
    ended = replace(NONE, limit="where largest=53 ends the search")
    assert str(ended) == (
        "no precision up to 53 digits, where largest=53 ends the search, meets the tolerance (emulation, 60 steps)"
    )


def test_the_reason_is_told_where_it_prevented_a_smaller_answer():
    assert str(replace(FOUND, why="it stopped")) == str(FOUND)
    stopped = replace(FOUND, why="it stopped", tried=((8, float("inf")), (9, 0.4567)))
    assert str(stopped) == f"{FOUND}; it stopped"
    assert str(replace(NONE, why="it stopped")) == f"{NONE}; it stopped"


def test_notes_follow_in_the_order_of_their_weight():
    noted = replace(FOUND, irregular=(6, 7), tried=((6, 0.9), (7, 0.9), (8, 2.0), (9, 0.4)))
    noted = replace(noted, repairs=("Q made symmetric",), advice="Joseph meets it")
    assert str(noted).endswith(
        " (bound, 60 steps); 6, 7 digits meet it, but 8 do not; Q made symmetric; Joseph meets it"
    )
    irregular = replace(NONE, irregular=(50,), tried=((50, 0.5), (51, 2.0), (52, 3.0), (53, float("nan"))))
    assert str(irregular) == (
        "no precision up to 53 digits meets the tolerance reliably (emulation, 60 steps); "
        "50 digits meet it, but 51–53 do not"
    )


@pytest.mark.parametrize(
    ("numbers", "text"), [((), ""), ((2,), "2"), ((2, 3), "2, 3"), ((2, 3, 4), "2–4"), ((2, 5, 6, 7, 9), "2, 5–7, 9")]
)
def test_three_in_a_row_are_a_range(numbers, text):
    assert listed(numbers) == text
