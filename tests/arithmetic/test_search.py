"""gpbnb.arithmetic.search: the smallest precision that qualifies, and what was tried on the way to it."""

from __future__ import annotations

import math

import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.search import Outcome, Search, smallest_precision


def among(good, calls=None):
    """A requirement that the given precisions meet; `calls` lists what was tried."""

    def meets(fmt):
        if calls is not None:
            calls.append(fmt.precision)
        return fmt.precision in good

    return meets


def test_a_monotone_requirement_is_found_in_every_range():
    for least in [1, 2, 5]:
        for largest in [5, 8, 13]:
            for monotone in [True, False]:
                for first in range(least, largest + 2):
                    calls: list[int] = []
                    found = smallest_precision(
                        among(range(first, 99), calls), 2, least=least, largest=largest, monotone=monotone
                    )
                    assert found == (FloatFormat(2, first) if first <= largest else None)
                    assert len(calls) == len(set(calls))
                    assert set(calls) <= set(range(least, largest + 1))


def test_whatever_meets_the_requirement_the_answer_qualifies_and_the_next_lower_one_does_not():
    """All requirements on eight precisions."""
    for bits in range(2**8):
        good, calls = {k + 1 for k in range(8) if bits >> k & 1}, []
        found = smallest_precision(among(good, calls), largest=8)
        outcome = Search(
            lambda fmt, good=good: Outcome(1 + (fmt.precision not in good)), FloatFormat(2, 5), (), largest=8, least=1
        )
        assert outcome.fmt == found
        if found is None:
            assert 8 not in good
            continue
        answer = found.precision
        assert {answer, min(answer + 1, 8)} <= good & set(calls)
        assert answer == 1 or answer - 1 in set(calls) - good


@pytest.mark.parametrize(
    ("missed", "answer", "irregular"),
    [
        ({16}, 17, range(6, 16)),
        ({7, 16}, 17, (6, *range(8, 16))),
        ({16, 17}, None, range(6, 16)),  # 18 alone could be chance
        ({16, 18}, None, (*range(6, 16), 17)),
        ({17, 18}, 6, ()),  # 16 refutes nothing, and those above are not tried
    ],
)
def test_above_an_answer_that_is_refuted_every_precision_is_tried(missed, answer, irregular):
    """In base 10, up to 18 digits, of which 5 and fewer miss the tolerance."""
    found = Search(lambda fmt: Outcome(1 + (fmt.precision < 6 or fmt.precision in missed)), FloatFormat(10, 5), (7, 16))
    assert found.fmt == (None if answer is None else FloatFormat(10, answer))
    assert found.irregular == tuple(irregular)
    assert not found.undecided


@pytest.mark.parametrize(
    ("ratios", "answer", "undecided"),
    [({16: math.inf}, 6, (16,)), ({16: 2.0}, 17, ()), ({8: 2.0, 16: math.inf}, 17, ())],
)
def test_where_there_is_no_bound_above_an_answer_it_stays_and_a_missed_one_refutes_it(ratios, answer, undecided):
    """In base 10: 5 digits and fewer miss the tolerance, 16 and perhaps 8 have no bound or miss it, too."""

    def error(fmt):
        return Outcome(ratios.get(fmt.precision, 1 + (fmt.precision < 6)))

    found = Search(error, FloatFormat(10, 5), (7, 16), bounds=True)
    assert (found.fmt, found.undecided) == (FloatFormat(10, answer), undecided)
