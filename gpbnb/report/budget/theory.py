"""Error budgets: root-sum-square, worst case, the share of each source, and how much averaging reduces it."""

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
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypeVar

from gpbnb.sweeps import plain_number

GOAL = 1.0
"""The total that Figure II-2 assumes and the design goal in ch. I; milliarcseconds per year."""


class Kind(Enum):
    """How an error behaves statistically: the first classification in ch. II."""

    DETERMINISTIC = "deterministic"
    CONSTANT = "random constant"
    PROCESS = "random process"


class ErrorForm(Enum):
    """How an error enters a reading: the second classification in ch. II."""

    BIAS = "bias"
    DRIFT = "drift"
    SCALE_FACTOR = "scale factor"
    NOISE = "noise"


METHODS = ("roll", "orbit", "filter")
"""The three ways to reduce an error are averaging over rolls, averaging over orbits, and filtering."""

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
    """List the methods that ch. II names for errors of this kind or form; deterministic errors are compensated."""
    return frozenset(_BY_KIND[kind] | _BY_FORM[form])


@dataclass(frozen=True)
class Source:
    """One source of error in a budget.

    Parameters
    ----------
    name : unique within a budget.
    kind, form : its class in each of the two classifications.
    error : standard deviation before reduction, in milliarcseconds; for a deterministic error, the part that remains
        after compensation. The sign matters only within a group.
    roll, orbit, filter : fraction of the error that remains after each method, from 0 to 1; 1 if it is not used.
    group : sources of the same group are fully correlated and add up with their signs; empty for an independent one.
    note : free text.
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
                raise ValueError(
                    f"got {name} {text!r}; needed a text without leading or trailing blanks, and a name "
                    "for every source"
                )
        if not isinstance(self.kind, Kind) or not isinstance(self.form, ErrorForm):
            raise ValueError(f"got kind {self.kind!r} and form {self.form!r}; needed a Kind and an ErrorForm")
        if not math.isfinite(self.error):
            raise ValueError(f"got error {self.error}; needed a finite number of milliarcseconds")
        for method in METHODS:
            factor = getattr(self, method)
            if not 0 <= factor <= 1:
                raise ValueError(
                    f"got {method} {factor}; needed a factor from 0 (nothing remains) to 1 (method not used)"
                )

    @property
    def residual(self) -> float:
        """The error after reduction, with its sign; milliarcseconds."""
        return self.error * self.roll * self.orbit * self.filter

    @property
    def unforeseen(self) -> tuple[str, ...]:
        """The methods in use that ch. II does not name for this kind or form of error."""
        allowed = foreseen(self.kind, self.form)
        return tuple(method for method in METHODS if getattr(self, method) < 1 and method not in allowed)


@dataclass(frozen=True)
class Budget:
    """A list of error sources."""

    sources: tuple[Source, ...]

    def __post_init__(self) -> None:
        counts = Counter(source.name for source in self.sources)
        twice = sorted(name for name, count in counts.items() if count > 1)
        if twice:
            raise ValueError(
                f"got {', '.join(map(repr, twice))} more than once; every source needs its own name: rename one"
            )

    def groups(self) -> tuple[tuple[Source, ...], ...]:
        """Group the sources that add up with their signs, in order of appearance."""
        found: dict[str, list[Source]] = {}
        for source in self.sources:
            found.setdefault(f"group {source.group}" if source.group else f"source {source.name}", []).append(source)
        return tuple(map(tuple, found.values()))

    @cached_property
    def _sums(self) -> dict[str, float]:
        """Map the name of each source to the sum over its group."""
        return {source.name: total for group in self.groups() for total in (_sum(group),) for source in group}

    @cached_property
    def total(self) -> float:
        r"""Root-sum-square over groups, :math:`\sqrt{\sum_g (\sum_{j\in g} e_j)^2}`; milliarcseconds."""
        return root_sum_square(map(_sum, self.groups()))

    @property
    def worst_case(self) -> float:
        """Sum of all residuals as if they had the same sign; milliarcseconds."""
        return math.fsum(abs(source.residual) for source in self.sources)

    def share(self, source: Source) -> float:
        """Return the part of the square of the total that is due to `source`.

        Shares add up to one. A share is negative if the source cancels others in its group. For a total of 0 all
        shares are 0.
        """
        square = self.total**2
        return source.residual * self._sums[source.name] / square if square else 0.0

    def allowance(self, goal: float = GOAL) -> float:
        """Return the largest error allowed for one more independent source; NaN if the total already exceeds `goal`."""
        left = goal**2 - self.total**2
        return math.sqrt(left) if left >= 0 else math.nan


def _sum(group: Iterable[Source]) -> float:
    return math.fsum(source.residual for source in group)


# -- sums -----------------------------------------------------------------------------------------


def root_sum_square(errors: Iterable[float]) -> float:
    """Return the root of the sum of squares, without overflow; hung1982, ch. II."""
    return math.hypot(*errors)


def equal_error(total: float, sources: float) -> float:
    r"""Return the size of each of N equal, independent errors, :math:`e = \text{total}/\sqrt N`: Figure II-2.

    Parameters
    ----------
    total : root-sum-square of all errors, in any unit; 0 or above.
    sources : N, above 0.
    """
    if not (total >= 0 and sources > 0):
        raise ValueError(f"got a total of {total} over {sources} sources; needed total >= 0 and sources > 0")
    return total / math.sqrt(sources)


def equal_sources(total: float, each: float) -> float:
    """Return the number, not rounded, of equal independent errors of size `each` whose root-sum-square is `total`."""
    if not (total >= 0 and each > 0):
        raise ValueError(f"got a total of {total} from errors of {each}; needed total >= 0 and each > 0")
    return (total / each) ** 2


# -- what averaging leaves ------------------------------------------------------------------------


def cycles_factor(cycles: float) -> float:
    r"""Return the largest fraction of a cyclic error that remains in a mean over `cycles`: :math:`|\sin\pi c|/(\pi c)`.

    The error is a constant that rolls with the spacecraft, or it repeats with the orbit. A mean over whole cycles
    removes it.
    """
    if not cycles >= 0:
        raise ValueError(f"got {cycles} cycles; needed 0 or more")
    if cycles == 0:
        return 1.0
    # the remainder is exact in float64; sin(pi c) of a large c is not accurate
    return abs(math.sin(math.pi * math.remainder(cycles, 1.0))) / (math.pi * cycles)


def white_factor(readings: float) -> float:
    r"""Return the fraction of noise that remains in a mean of N independent readings: :math:`1/\sqrt N`."""
    if not readings >= 1:
        raise ValueError(f"got {readings} readings; needed 1 or more")
    return 1 / math.sqrt(readings)


def correlated_factor(time: float, correlation_time: float) -> float:
    r"""Return the fraction of noise with the correlation :math:`\mathrm e^{-u/\tau}` that remains in a mean over T.

    .. math:: \sqrt{2(h - 1 + \mathrm e^{-h})}\,/\,h, \qquad h = T/\tau

    The fraction refers to the standard deviation. For small h the function sums a series, because the closed
    form cancels.

    Parameters
    ----------
    time, correlation_time : T and τ, in the same unit; T at least 0, τ above 0.
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
    """A rejected row: its line, the reason, and its cells as read."""

    line: int
    reason: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class ReadBudget:
    """Contents of a file: the budget from its valid rows, and the rejected rows."""

    budget: Budget
    refused: tuple[Refused, ...]


def read(path: str | Path | Traversable) -> ReadBudget:
    """Read a budget from a CSV file, which is not changed.

    The first line names the columns: ``name, kind, form, error_mas`` and any of ``roll, orbit, filter, group, note``,
    in any order. An empty factor means that the method is not used. An invalid row is rejected with its line number;
    the other rows are still read.
    """
    file = Path(path) if isinstance(path, str) else path
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{file.name} is not UTF-8 ({error}); save it as UTF-8") from error
    return parse(text, file.name)


def parse(text: str, name: str = "the text") -> ReadBudget:
    """Read a budget from the text of a CSV file, as :func:`read` does; error messages call it `name`."""
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
                raise ValueError(f"name {source.name!r} is already used in line {lines[source.name]}; rename one")
        except ValueError as error:
            refused.append(Refused(line, str(error), tuple(cells)))
        else:
            sources[source.name], lines[source.name] = source, line
    return ReadBudget(Budget(tuple(sources.values())), tuple(refused))


def to_csv(sources: Sequence[Source]) -> str:
    """Format sources as CSV with the columns `HEADER`; a factor of 1 is left empty.

    Text that a spreadsheet would read as a formula gets a leading apostrophe, which :func:`read` removes.
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
    """Return text that no spreadsheet mistakes for a formula."""
    return f"'{text}" if _FORMULA.match(text) else text


def _unguarded(text: str) -> str:
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def _source(header: tuple[str, ...], cells: list[str]) -> Source:
    if len(cells) != len(header):
        raise ValueError(
            f"got {len(cells)} cells; needed {len(header)}; put quotes around a cell that contains a comma"
        )
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
        raise ValueError(f"{column} is {text!r}; enter a number, or omit the row until it is known") from None


def _member(enum: type[_E], column: str, text: str) -> _E:
    try:
        return enum(text)
    except ValueError:
        raise ValueError(f"{column} is {text!r}; needed one of {', '.join(member.value for member in enum)}") from None
