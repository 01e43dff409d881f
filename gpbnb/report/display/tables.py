"""Tables for notebooks and the command line: Markdown with math."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

POWER = re.compile(r"(?<![\w.])(\d[\d.]*)e([+-]?\d+)(?!\w)")
"""A number with a power of ten as Python writes it, such as ``1.5e-08``."""


MOST_ROWS = 12
"""A page folds a table with more rows."""
_PLAIN = (1e-5, 1e7)
"""A column whose numbers lie between these limits has no powers of ten."""
_SHORT = re.compile(
    r"\$?([+\-−]?)([\d,]*)(\.\d+)?(?:e([+-]?\d+)|\\times10\^\{([+-]?\d+)\})?\$?((?: ?[%°′″].*| [^\d\s.,+−-].{0,30})?)"
)
_HYPHEN = re.compile(r"(?<![\w.)\]])-(?=\.?\d)")
_DIGIT, _POINT = "&#8199;", "&#8200;&#8288;"
"""Spaces as wide as a digit and as a comma, after which no line ends. Entities survive where white space is cut off."""


@dataclass(frozen=True)
class Table:
    """A table that notebooks display as Markdown, with math.

    Parameters
    ----------
    title : short plain text that stands for the table, and for its rows where a page folds it.
    header, body : cells; prose with math between single dollar signs.
    """

    title: str
    header: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table as lines with the same number of cells between unescaped pipes."""
        return _lines(self.header, [list(map(_cell, row)) for row in self.body])

    def page(self) -> str:
        """Return the table as a page shows it.

        Numbers stand with their decimal points one below the other, in one notation a column, with minus signs. A line
        below the table says what is the same in each row. A table of more than twelve rows is folded.
        """
        columns = [list(column) for column in zip(*self.body, strict=True)]
        same = [k for k, cells in enumerate(columns) if k and len(cells) > 1 and len(set(cells)) == 1 and cells[0]]
        kept = [k for k in range(len(columns)) if k not in same]
        if len(kept) < 2:
            same, kept = [], list(range(len(columns)))
        header = [self.header[k] for k in kept] if columns else list(self.header)
        text = _lines(header, [list(row) for row in zip(*(_aligned(columns[k]) for k in kept), strict=True)])
        if same:
            words = "; ".join(f"{_cell(self.header[k])} = {_cell(minus_signs(columns[k][0]))}" for k in same)
            text += f"\n\nIn all rows: {words}."
        if len(self.body) > MOST_ROWS:
            summary = f"{html.escape(self.title)}, {len(self.body)} rows"
            text = f'<details class="long-table"><summary>{summary}</summary>\n\n{text}\n\n</details>'
        return text

    def _repr_markdown_(self) -> str:
        return self.page()

    def __repr__(self) -> str:
        return f"<{self.title}>"


class _Number(NamedTuple):
    """The parts of a cell that begins with a number."""

    sign: str
    whole: str
    fraction: str
    power: int | None
    rest: str

    @property
    def value(self) -> Decimal:
        return Decimal(f"{self.whole or 0}{self.fraction}") * Decimal(10) ** (self.power or 0)

    @property
    def figures(self) -> int:
        """Significant digits; the zeros at the end of a whole number are none."""
        digits = (self.whole + self.fraction[1:]).lstrip("0")
        return max(1, len(digits if self.fraction else digits.rstrip("0")))


def _aligned(cells: list[str]) -> list[str]:
    """Return the cells of a column as Markdown: numbers in one notation, after spaces that align their points.

    Texts stay as they are; a list of numbers, or a number with digits after it, makes the column one of texts.
    """
    numbers = list(map(_number, cells))
    if any(number is None and re.match(r"\$?[+−-]?[.\d]", cell) for number, cell in zip(numbers, cells, strict=True)):
        return [_cell(minus_signs(cell)) for cell in cells]
    given = [number for number in numbers if number]
    for unit in {each.rest for each in given if each.power is not None}:
        alike = [k for k, each in enumerate(given) if each.rest == unit]
        for k, each in zip(alike, _one_notation([given[k] for k in alike]), strict=True):
            given[k] = each
    if any(len(each.whole) > 4 for each in given):
        given = [each._replace(whole=f"{int(each.whole):,}") for each in given]
    signs = any(each.sign for each in given)
    widest = max((each.whole for each in given), key=len, default="")
    rest = iter(given)
    found = []
    for number, cell in zip(numbers, cells, strict=True):
        if number is None:
            found.append(_cell(minus_signs(cell)))
            continue
        each = next(rest)
        missing = widest[: len(widest) - len(each.whole)]
        pad = _DIGIT * (signs and not each.sign) + "".join(_POINT if sign == "," else _DIGIT for sign in missing)
        power = "" if not each.power else f"e{each.power:+03d}"
        found.append(f"{pad}{each.sign}{each.whole}{each.fraction}{power}{_rest(each.rest)}")
    return found


def _number(cell: str) -> _Number | None:
    match = _SHORT.fullmatch(cell)
    if match is None or not (match[2] or match[3]):
        return None
    power = match[4] or match[5]
    whole = match[2].replace(",", "") or "0"
    return _Number(match[1].replace("-", "−"), whole, match[3] or "", int(power) if power else None, match[6])


def _one_notation(numbers: list[_Number]) -> list[_Number]:
    """Write all numbers of a column plainly if none is very large or small, otherwise all with a power of ten."""
    sizes = [each.value for each in numbers if each.value]
    if all(_PLAIN[0] <= size <= _PLAIN[1] for size in sizes):
        places = [max(0, len(each.fraction[1:]) - (each.power or 0)) for each in numbers]
        plain = [f"{each.value:.{k}f}".partition(".") for each, k in zip(numbers, places, strict=True)]
        return [
            each._replace(whole=whole, fraction=point + fraction, power=None)
            for each, (whole, point, fraction) in zip(numbers, plain, strict=True)
        ]
    figures = max(each.figures for each in numbers)
    found = []
    for each in numbers:
        if not each.value:
            found.append(each._replace(whole="0", fraction="", power=None))
            continue
        mantissa, _, power = f"{each.value:.{figures - 1}e}".partition("e")
        whole, point, fraction = mantissa.partition(".")
        found.append(each._replace(whole=whole, fraction=point + fraction, power=int(power)))
    return found


def _rest(text: str) -> str:
    return " " * text.startswith(" ") + _cell(minus_signs(text))


def minus_signs(text: str) -> str:
    """Write minus signs for the hyphens before numbers in prose."""
    parts = text.split("$")
    parts[::2] = [_HYPHEN.sub("−", prose) for prose in parts[::2]]
    return "$".join(parts)


def _lines(header: Iterable[str], body: Sequence[Sequence[str]]) -> str:
    head = list(map(_cell, header))
    lines = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def scientific(value: Fraction | float, figures: int) -> str:
    r"""Format a number with `figures` digits and a power of ten, as in ``$2.5860\times10^{8}$``."""
    mantissa, _, power = f"{float(value):.{figures - 1}e}".partition("e")
    return f"${mantissa}\\times10^{{{int(power)}}}$" if int(power) else f"${mantissa}$"


def short(value: float, figures: int = 2) -> str:
    """Format a number for a cell: plain, or with a power of ten if it is very large or small."""
    rounded = float(f"{value:.{figures - 1}e}")
    if rounded == 0 or not math.isfinite(value):
        return f"{rounded:g}"
    if 1e-4 <= abs(rounded) < 1e6:
        return f"{Decimal(repr(rounded)):f}".removesuffix(".0")
    return scientific(rounded, figures)


def one_line(text: str) -> str:
    """Fold white space, line ends included, into single spaces."""
    return " ".join(text.split())


def _cell(text: str) -> str:
    r"""Turn `text` into a Markdown cell: prose escaped, and `|` and `\|` within math as `\vert` and `\Vert`."""
    parts = one_line(text).split("$")
    parts[::2] = [re.sub(r"([\\`*_{}\[\]<>|~^#&])", r"\\\1", prose) for prose in parts[::2]]
    parts[1::2] = [re.sub(r"\\\\|\\\||\|", _bar, math) for math in parts[1::2]]
    return "$".join(parts)


def _bar(match: re.Match[str]) -> str:
    return {"|": r"\vert ", r"\|": r"\Vert "}.get(match[0], match[0])
