"""Tables for notebooks and the command line: Markdown with math."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpbnb.arithmetic.fixed import FixedFormat
    from gpbnb.arithmetic.formats import FloatFormat

POWER = re.compile(r"(?<![\w.])(\d[\d.]*)e([+-]?\d+)(?!\w)")
"""A number with a power of ten as Python writes it, such as ``1.5e-08``."""


@dataclass(frozen=True)
class Table:
    """A table that notebooks display as Markdown, with math.

    Parameters
    ----------
    title : short plain text that stands for the table.
    header, body : cells; prose with math between single dollar signs.
    """

    title: str
    header: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table as lines with the same number of cells between unescaped pipes."""
        lines = [map(_cell, self.header), ("---",) * len(self.header), *(map(_cell, row) for row in self.body)]
        return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)

    def _repr_markdown_(self) -> str:
        return self.markdown()

    def __repr__(self) -> str:
        return f"<{self.title}>"


def digits(fmt: FloatFormat | FixedFormat) -> str:
    """Name the precision of a format, as in "4 decimal digits" or "24 bits"."""
    unit = {2: "bit", 10: "decimal digit"}.get(fmt.base, f"base-{fmt.base} digit")
    return f"{fmt.precision} {unit}{'s' if fmt.precision > 1 else ''}"


_ROUNDINGS = {
    "nearest": "",
    "chop": ", chopped",
    "even": ", ties to even",
    "up": ", rounded up",
    "down": ", rounded down",
    "odd": ", rounded to odd",
    "stochastic": ", stochastically rounded",
}


def arithmetic(fmt: FloatFormat | FixedFormat) -> str:
    """Name digits, rounding and range of a format, as in "24 bits, ties to even, exponents -126 to 127"."""
    rounding, fraction = _ROUNDINGS[fmt.rounding.value], getattr(fmt, "fraction_bits", None)
    if fraction is not None:
        overflow = {"saturate": ", saturated", "wrap": ", wrapped around"}.get(getattr(fmt, "overflow", ""), "")
        return f"fixed point of {1 + fmt.precision} bits, {fraction} of them fraction{rounding}{overflow}"
    least, largest = getattr(fmt, "emin", None), getattr(fmt, "emax", None)
    if least is None:
        return digits(fmt) + rounding
    flushed = "" if getattr(fmt, "subnormal", True) else ", no subnormal numbers"
    return f"{digits(fmt)}{rounding}, exponents {least} to {largest}{flushed}"


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
