"""gpbnb.tables: Markdown tables with math."""

from __future__ import annotations

import re

import pytest

from gpbnb.formats import FloatFormat
from gpbnb.tables import Table, digits, one_line


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
