"""A list of error sources: its root-sum-square, worst case and shares, and what averaging leaves of each."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from gpbnb.sweeps import plain_number

GOAL = 1.0
"""The basis of Figure II-2 and the design goal of ch. I, in milliarcseconds a year."""


class Kind(Enum):
    """The first classification, by statistics."""

    DETERMINISTIC = "deterministic"
    CONSTANT = "random constant"
    PROCESS = "random process"


class ErrorForm(Enum):
    """The second classification, by form."""

    BIAS = "bias"
    DRIFT = "drift"
    SCALE_FACTOR = "scale factor"
    NOISE = "noise"


METHODS = ("roll", "orbit", "filter")
"""Ways to reduce an error. Averaging over rolls, averaging over orbits, filtering."""

_BY_KIND: dict[Kind, set[str]] = {
    Kind.DETERMINISTIC: set(),
    Kind.CONSTANT: {"roll", "orbit"},
    Kind.PROCESS: {"roll", "orbit", "filter"},
}
_BY_FORM: dict[ErrorForm, set[str]] = {
    ErrorForm.BIAS: {"roll", "orbit"},
    ErrorForm.DRIFT: set(),
    ErrorForm.SCALE_FACTOR: {"filter"},
    ErrorForm.NOISE: {"filter"},
}


def foreseen(kind: Kind, form: ErrorForm) -> frozenset[str]:
    """Methods that ch. II names for errors of this kind or of this form; what is deterministic is compensated."""
    return frozenset(_BY_KIND[kind] | _BY_FORM[form])


@dataclass(frozen=True)
class Source:
    """One error source.

    Parameters
    ----------
    name : unique in a budget.
    kind, form : both classifications.
    error : its standard deviation before reduction, in milliarcseconds; of a deterministic error what compensation
        leaves. The sign counts only among sources of one group.
    roll, orbit, filter : what each method leaves, as a factor from 0 to 1; 1 where it is not used.
    group : sources of one group are fully correlated and add up with their signs; empty for a source by itself.
    note : free text.

    Raises
    ------
    ValueError : a blank name, an error that is not finite, a factor outside 0 to 1.
    """

    name: str
    kind: Kind
    form: ErrorForm
    error: float
    roll: float = 1.0
    orbit: float = 1.0
    filter: float = 1.0
    group: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        for name in ("name", "group", "note"):
            text = getattr(self, name)
            if text != text.strip() or (name == "name" and not text):
                raise ValueError(f"got {name} {text!r}; needed text without blanks at its ends; a name, at least")
        if not isinstance(self.kind, Kind) or not isinstance(self.form, ErrorForm):
            raise ValueError(f"got kind {self.kind!r} and form {self.form!r}; needed a Kind and an ErrorForm")
        if not math.isfinite(self.error):
            raise ValueError(f"got error {self.error}; needed a finite number of milliarcseconds")
        for method in METHODS:
            factor = getattr(self, method)
            if not 0 <= factor <= 1:
                raise ValueError(f"got {method} {factor}; needed a factor from 0 (nothing left) to 1 (not used)")

    @property
    def residual(self) -> float:
        """The error after reduction, with its sign; milliarcseconds."""
        return self.error * self.roll * self.orbit * self.filter

    @property
    def unforeseen(self) -> tuple[str, ...]:
        """Methods used that ch. II does not name for such an error."""
        allowed = foreseen(self.kind, self.form)
        return tuple(method for method in METHODS if getattr(self, method) < 1 and method not in allowed)


@dataclass(frozen=True)
class Budget:
    """Error sources together.

    Raises
    ------
    ValueError : two sources of one name.
    """

    sources: tuple[Source, ...]

    def __post_init__(self) -> None:
        counts = Counter(source.name for source in self.sources)
        twice = sorted(name for name, count in counts.items() if count > 1)
        if twice:
            raise ValueError(f"got {', '.join(map(repr, twice))} more than once; needed one name a source: rename one")

    def groups(self) -> tuple[tuple[Source, ...], ...]:
        """Sources that add up with their signs, together; in order of appearance."""
        found: dict[str, list[Source]] = {}
        for source in self.sources:
            found.setdefault(f"group {source.group}" if source.group else f"source {source.name}", []).append(source)
        return tuple(map(tuple, found.values()))

    @cached_property
    def _sums(self) -> dict[str, float]:
        """By name of a source, the sum over its group."""
        return {source.name: total for group in self.groups() for total in (_sum(group),) for source in group}

    @cached_property
    def total(self) -> float:
        r"""Root-sum-square over groups, :math:`\sqrt{\sum_g (\sum_{j\in g} e_j)^2}`; milliarcseconds."""
        return root_sum_square(map(_sum, self.groups()))

    @property
    def worst_case(self) -> float:
        """All errors with one sign; milliarcseconds."""
        return math.fsum(abs(source.residual) for source in self.sources)

    def share(self, source: Source) -> float:
        """Part of the total's square that is due to `source`; below 0 where it cancels others of its group.

        Shares add up to one. All are 0 where the total is 0.
        """
        square = self.total**2
        return source.residual * self._sums[source.name] / square if square else 0.0

    def allowance(self, goal: float = GOAL) -> float:
        """What one more independent source may be before the total is `goal`; milliarcseconds. NaN if it is already."""
        left = goal**2 - self.total**2
        return math.sqrt(left) if left >= 0 else math.nan


def _sum(group: Iterable[Source]) -> float:
    return math.fsum(source.residual for source in group)


# -- sums -----------------------------------------------------------------------------------------


def root_sum_square(errors: Iterable[float]) -> float:
    """Root of the sum of squares, without overflow; hung1982, ch. II."""
    return math.hypot(*errors)


def equal_error(total: float, sources: float) -> float:
    r"""Size of each of N equal, independent errors, :math:`e = \text{total}/\sqrt N`: Figure II-2.

    Parameters
    ----------
    total : their root-sum-square, in any unit; 0 or above.
    sources : N, above 0.
    """
    if not (total >= 0 and sources > 0):
        raise ValueError(f"got a total of {total} over {sources} sources; needed total >= 0 and sources > 0")
    return total / math.sqrt(sources)


def equal_sources(total: float, each: float) -> float:
    """How many equal, independent errors of the size `each` make up `total`; need not be whole."""
    if not (total >= 0 and each > 0):
        raise ValueError(f"got a total of {total} from errors of {each}; needed total >= 0 and each > 0")
    return (total / each) ** 2


# -- what averaging leaves ------------------------------------------------------------------------


def cycles_factor(cycles: float) -> float:
    r"""What a mean over `cycles` turns leaves of a constant that turns, at most: :math:`|\sin\pi c|/(\pi c)`.

    The constant stands in the spacecraft and rolls, or keeps step with the orbit. It vanishes for whole cycles.
    """
    if not cycles >= 0:
        raise ValueError(f"got {cycles} cycles; needed 0 or more")
    if cycles == 0:
        return 1.0
    # the remainder is exact in float64: sin(pi c) of a large c is not
    return abs(math.sin(math.pi * math.remainder(cycles, 1.0))) / (math.pi * cycles)


def white_factor(readings: float) -> float:
    r"""What a mean of N independent readings leaves of noise: :math:`1/\sqrt N`."""
    if not readings >= 1:
        raise ValueError(f"got {readings} readings; needed 1 or more")
    return 1 / math.sqrt(readings)


def correlated_factor(time: float, correlation_time: float) -> float:
    r"""What a mean over T leaves of noise with the correlation :math:`\mathrm e^{-u/\tau}`, standard deviation.

    .. math:: \sqrt{2(h - 1 + \mathrm e^{-h})}\,/\,h, \qquad h = T/\tau

    For small h a series is summed, since the closed form loses its digits.

    Parameters
    ----------
    time, correlation_time : T and τ, in one unit; T at least 0, τ above 0.
    """
    if not (time >= 0 and correlation_time > 0):
        raise ValueError(f"got T = {time} and tau = {correlation_time}; needed T >= 0 and tau > 0")
    h = time / correlation_time
    if h < 0.5:
        # 2 sum_k (-h)^k / (k + 2)!; thirteen terms leave less than 1e-16 at h = 1/2
        return math.sqrt(2 * math.fsum((-h) ** k / math.factorial(k + 2) for k in range(13)))
    return math.sqrt(2 * (h + math.expm1(-h))) / h


# -- reading and writing --------------------------------------------------------------------------

HEADER = ("name", "kind", "form", "error_mas", "roll", "orbit", "filter", "group", "note")
_NEEDED = HEADER[:4]
_E = TypeVar("_E", bound=Enum)


@dataclass(frozen=True)
class Refused:
    """A row that cannot be read: its line, why, and its cells as they came."""

    line: int
    reason: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Reading:
    """What a file holds: the budget of its good rows, and the others."""

    budget: Budget
    refused: tuple[Refused, ...]


def read(path: str | Path) -> Reading:
    """Read a budget from a CSV file, which is not changed.

    The first line names the columns: ``name, kind, form, error_mas`` and as many of ``roll, orbit, filter, group,
    note`` as there are, in any order. An empty factor means that the method is not used. A bad row is refused, with
    its line; the others are read all the same.

    Raises
    ------
    OSError : the file cannot be read.
    ValueError : it is not UTF-8, or its first line lacks a column, repeats one, or has one that is not known.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path.name} is not UTF-8 ({error}); save it as UTF-8") from error
    return parse(text, path.name)


def parse(text: str, name: str = "the text") -> Reading:
    """Read a budget from the text of a CSV file, as :func:`read`; `name` is what errors call it."""
    reader = csv.reader(io.StringIO(text, newline=""))
    header = tuple(cell.strip() for cell in next(reader, []))
    missing = [column for column in _NEEDED if column not in header]
    strange = [column for column in header if column not in HEADER or header.count(column) > 1]
    if missing or strange:
        raise ValueError(
            f"{name}, line 1: got columns {', '.join(header) or 'none'}; needed {', '.join(_NEEDED)}, each once, and "
            f"any of {', '.join(HEADER[4:])}"
            + (f"; {', '.join(missing)} missing" if missing else "")
            + (f"; {', '.join(dict.fromkeys(strange))} unknown or repeated" if strange else "")
        )
    sources: dict[str, Source] = {}
    lines: dict[str, int] = {}
    refused: list[Refused] = []
    start = reader.line_num + 1
    while True:
        try:
            cells = next(reader)
        except StopIteration:
            break
        except csv.Error as error:
            refused.append(Refused(start, f"not CSV: {error}", ()))
            start = reader.line_num + 1
            continue
        line, start = start, reader.line_num + 1
        if not any(cell.strip() for cell in cells):
            continue
        try:
            source = _source(header, cells)
            if source.name in sources:
                raise ValueError(f"name {source.name!r} is that of line {lines[source.name]} already; rename one")
        except ValueError as error:
            refused.append(Refused(line, str(error), tuple(cells)))
        else:
            sources[source.name], lines[source.name] = source, line
    return Reading(Budget(tuple(sources.values())), tuple(refused))


def write(budget: Budget, path: str | Path) -> None:
    """Write a budget as a new CSV file, which :func:`read` turns into the same budget.

    Raises
    ------
    FileExistsError : the file is there; rows that were refused from it would be lost.
    """
    with Path(path).open("x", encoding="utf-8", newline="") as file:
        file.write(to_csv(budget.sources))


def to_csv(sources: Sequence[Source]) -> str:
    """Sources as CSV with the columns `HEADER`; a factor of 1 is left empty.

    Text that a spreadsheet would take for a formula gets an apostrophe in front, which :func:`read` removes.
    """
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(HEADER)
    for source in sources:
        factors = ("" if getattr(source, method) == 1 else repr(getattr(source, method)) for method in METHODS)
        writer.writerow(
            [
                _guarded(source.name),
                source.kind.value,
                source.form.value,
                repr(source.error),
                *factors,
                _guarded(source.group),
                _guarded(source.note),
            ]
        )
    return out.getvalue()


_FORMULA = re.compile(r"'*[=+\-@]")


def _guarded(text: str) -> str:
    """Text that no spreadsheet takes for a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def _unguarded(text: str) -> str:
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def _source(header: tuple[str, ...], cells: list[str]) -> Source:
    if len(cells) != len(header):
        raise ValueError(f"{len(cells)} cells; {len(header)} are needed: quote a cell that holds a comma")
    row = {field.name: "" for field in fields(Source)} | dict(
        zip(header, (cell.strip() for cell in cells), strict=True)
    )
    factors = {method: _number(method, row[method]) if row[method] else 1.0 for method in METHODS}
    return Source(
        _unguarded(row["name"]),
        _member(Kind, "kind", row["kind"]),
        _member(ErrorForm, "form", row["form"]),
        _number("error_mas", row["error_mas"]),
        **factors,
        group=_unguarded(row["group"]),
        note=_unguarded(row["note"]),
    )


def _number(column: str, text: str) -> float:
    try:
        return plain_number(text)
    except ValueError:
        raise ValueError(f"{column} is {text!r}; a number is needed, or leave the row out until it is known") from None


def _member(enum: type[_E], column: str, text: str) -> _E:
    try:
        return enum(text)
    except ValueError:
        raise ValueError(f"{column} is {text!r}; needed one of {', '.join(member.value for member in enum)}") from None
