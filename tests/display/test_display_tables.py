"""gpbnb.report.display.tables: Markdown tables with math."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, IBM_HEX32
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.tables import Table, arithmetic, digits, one_line, scientific, short


def cells(line):
    """The cells of a line of Markdown, split at unescaped pipes."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def test_a_table_has_a_header_a_rule_and_its_rows():
    table = Table("two", ("a", "b"), (("1", "2"), ("3", "4")))
    assert table.markdown() == "| a | b |\n| --- | --- |\n| 1 | 2 |\n| 3 | 4 |"
    assert table._repr_markdown_() == table.markdown()
    assert repr(table) == "<two>"


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("plain", "plain"),
        ("a | b", r"a \| b"),
        ("x_1 * y", r"x\_1 \* y"),
        ("$|x|$", r"$\vert x\vert $"),
        (r"$\|A\|$", r"$\Vert A\Vert $"),
        (r"a_b $x_1 \| y$ c|d", r"a\_b $x_1 \Vert  y$ c\|d"),
        (r"$a\\|b|$", r"$a\\\vert b\vert $"),
        ("two\n  lines", "two lines"),
        ("<b>", r"\<b\>"),
    ],
)
def test_cells_are_escaped_as_prose_and_as_math(text, cell):
    table = Table("one", ("h",), ((text,),))
    line = table.markdown().splitlines()[2]
    assert line == f"| {cell} |"
    assert cells(line) == [cell.strip()]


def test_no_cell_can_break_the_table():
    texts = ("|", r"\|", "$|$", "a\n|\nb", r"$\left|x\right|$")
    table = Table("t", ("h",) * len(texts), (texts,))
    assert [len(cells(line)) for line in table.markdown().splitlines()] == [len(texts)] * 3


def test_an_empty_table_has_its_header():
    assert Table("none", ("a",), ()).markdown().splitlines() == ["| a |", "| --- |"]


def test_one_line():
    assert one_line("  a \n b\t c ") == "a b c"
    assert one_line("") == ""


def test_digits_names_base_and_precision():
    named = {(2, 1): "1 bit", (2, 24): "24 bits", (10, 1): "1 decimal digit", (10, 4): "4 decimal digits"}
    named |= {(16, 6): "6 base-16 digits", (3, 1): "1 base-3 digit"}
    assert {key: digits(FloatFormat(*key)) for key in named} == named


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [(82, 2, r"$8.2\times10^{1}$"), (Fraction(1, 3), 3, r"$3.33\times10^{-1}$"), (1, 2, "$1.0$")],
)
def test_scientific_numbers(value, figures, text):
    assert scientific(value, figures) == text


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [
        (0.0, 2, "0"),
        (131.2, 2, "130"),
        (0.00021, 2, "0.00021"),
        (-0.831, 2, "-0.83"),
        (999999.0, 2, r"$1.0\times10^{6}$"),
        (12500000.0, 3, r"$1.25\times10^{7}$"),
        (-1.13e-8, 2, r"$-1.1\times10^{-8}$"),
        (float("inf"), 2, "inf"),
    ],
)
def test_short_numbers(value, figures, text):
    assert short(value, figures) == text


def test_an_arithmetic_is_named_by_its_digits_and_by_chopping():
    assert arithmetic(FloatFormat(2, 24)) == "24 bits"
    assert arithmetic(FloatFormat(10, 4, Rounding.CHOP)) == "4 decimal digits, chopped"
    assert arithmetic(BINARY32) == "24 bits, ties to even, exponents -126 to 127"
    assert arithmetic(IBM_HEX32) == "6 base-16 digits, chopped, exponents -65 to 62, no subnormal numbers"
    assert arithmetic(FixedFormat(0, 15)) == "fixed point of 16 bits, 15 of them fraction"
    saturated = FixedFormat(2, 13, Rounding.DOWN, "saturate")
    assert arithmetic(saturated) == "fixed point of 16 bits, 13 of them fraction, rounded down, saturated"
    assert len({arithmetic(FloatFormat(2, 8, mode)) for mode in Rounding}) == len(Rounding)
