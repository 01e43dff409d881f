"""Table 1 of section 11.4: what any reading of the procedure gives."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from gpbnb.report.inversion import example, existence
from gpbnb.report.ledger.formula import Number
from gpbnb.report.ledger.statements import Statement, statement

Names = Mapping[str, Any]


@cache
def readings(column: str) -> tuple[example.PrintedColumn, ...]:
    """Return every reading of a column of Table 1, "proposed" or "actual"."""
    return tuple(example.bound_readings() if column == "proposed" else example.error_readings())


def _numbers(printed: Statement, column: str) -> dict[int, str]:
    """Return the printed numbers of a column, by the number of places."""
    found = [part for part in printed.parts if isinstance(part, Number) and part.label.startswith(column)]
    return {int(part.label.split()[1]): part.literal for part in found}


@cache
def _agree(column: str, places: int, literal: str) -> frozenset[int]:
    """Return the readings that give a printed number of a column to four digits."""
    i = example.PLACES.index(places)
    return frozenset(k for k, one in enumerate(readings(column)) if example.agree(one.values[i], literal))


def table() -> Names:
    """Return for each number of Table 1 whether a reading of the procedure gives it."""
    return {
        f"{column} {places}": lambda literal, column=column, places=places: bool(_agree(column, places, literal))
        for column in ("proposed", "actual")
        for places in example.PLACES
    }


def _reproduced(printed: Statement, column: str) -> str:
    """Say how many readings give all printed numbers of a column."""
    agree = [_agree(column, places, literal) for places, literal in _numbers(printed, column).items()]
    found = len(frozenset.intersection(*agree))
    return f"of {len(readings(column))} readings of the procedure, {found or 'none'} gives all printed digits"


@cache
def _closest(column: str) -> example.Agreements:
    return example.search("bound" if column == "proposed" else "error")


@cache
def _possible(places: tuple[int, ...]) -> tuple[int, int]:
    """Count the searches through all matrices of `places` places that find the printed error norm, and all searches."""
    here = [witness for searched, witness in existence.all_possible() if searched in places]
    return sum(witness is not None for witness in here), len(here)


def proposed_text(printed: Statement) -> str:
    search = _closest("proposed")
    values = [search.closest.values[example.PLACES.index(places)] for places in _numbers(printed, "proposed")]
    return (
        f"{_reproduced(printed, 'proposed')}; the closest one gives {', '.join(f'{v:.3e}' for v in values)}, which is "
        f"off by {search.closest.distance - 1:.1%}"
    )


def actual_text(printed: Statement) -> str:
    can, searches = _possible(tuple(_numbers(printed, "actual")))
    return (
        f"{_reproduced(printed, 'actual')}; the closest column is off by a factor of "
        f"{_closest('actual').closest.distance:.2f}; {can or 'none'} of {searches} searches through all matrices with "
        "this number of places, or with one digit more, finds a matrix whose error has the printed norm"
    )


def _claim(word: str) -> tuple[str, int]:
    """Return the sentence with a word, and the number of readings for which it holds."""
    (found,) = ((name, holds) for name, holds in example.claims().items() if word in name)
    return found


def claim_text(word: str) -> str:
    name, holds = _claim(word)
    return f"{name} in {holds} of {len(readings('proposed'))} ways of reading the procedure"


@cache
def claims() -> Names:
    """What is true of both columns of Table 1, as printed and in every reading."""
    printed = statement("hung1984.II.s11-4.table-1")
    columns = [[float(number) for number in _numbers(printed, column).values()] for column in ("proposed", "actual")]
    above, decreases = (_claim(word)[1] == len(readings("proposed")) for word in ("above", "decreases"))
    above = above and all(bound > 10 * error for bound, error in zip(*columns, strict=True))
    falling = decreases and all(a > b > c for a, b, c in columns)
    mantissas = {number.split("e")[0] for number in _numbers(printed, "proposed").values()}
    more = [one for one in readings("proposed") if one.detail.endswith("more digits")]
    same = sum(one.same_digits for one in more)
    margin = f"are {'indeed very' if above else 'not'} conservative"
    trend = "decreases" if falling else "increases"
    return {
        "margin": margin, "trend": trend, "verb": {margin, trend}, "same": same, "more": len(more),
        "mantissa": "the same mantissa" if len(mantissas) == 1 and same == len(more) else "different mantissas",
    }  # fmt: skip
