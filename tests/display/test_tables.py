"""gpbnb.report.display.tables: Markdown tables with math."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest

from gpbnb.report.display.tables import MOST_ROWS, Table, short


def cells(line):
    """The cells of a line of Markdown, split at unescaped pipes."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


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


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [
        (0.0, 2, "0"),
        (131.2, 2, "130"),
        (0.00021, 2, "0.00021"),
        (250000.0, 2, "250000"),
        (-0.831, 2, "-0.83"),
        (999999.0, 2, r"$1.0\times10^{6}$"),
        (12500000.0, 3, r"$1.25\times10^{7}$"),
        (-1.13e-8, 2, r"$-1.1\times10^{-8}$"),
        (float("inf"), 2, "inf"),
    ],
)
def test_short_numbers(value, figures, text):
    assert short(value, figures) == text


def column(*given):
    """The cells of a column as a page shows them, beside a column of names; spaces as wide as a digit are `_`."""
    body = tuple((f"row {chr(65 + i)}", cell) for i, cell in enumerate(given))
    text = html.unescape(Table("t", ("name", "h"), body).page())
    return [
        line.split(" | ")[1][:-2].replace("\u2007", "_").replace("\u2008\u2060", ",") for line in text.splitlines()[2:]
    ]


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        # decimal points one below the other
        (("9", "12.5", "0.03"), ["_9", "12.5", "_0.03"]),
        (("-1.5", "2", "+10"), ["_−1.5", "__2", "+10"]),
        (("3.6 %", "26.1 %"), ["_3.6 %", "26.1 %"]),
        (("0 of 100", "99 of 100"), ["_0 of 100", "99 of 100"]),
        (("8 bits, chopped", "24 bits"), ["_8 bits, chopped", "24 bits"]),
        (("0.24 ± 0.01", "60 ± 3"), ["_0.24 ± 0.01", "60 ± 3"]),
        # commas in all numbers of a column, if one has five digits or more
        (("13,036", "4", "5272"), ["13,036", "__,__4", "_5,272"]),
        (("2000", "999"), ["2000", "_999"]),
        # one notation
        (("675", "7.46e+03", "1.22e+12"), ["6.75e+02", "7.46e+03", "1.22e+12"]),
        (("2e+04", "300", "0.25"), ["20,000", "__,300", "__,__0.25"]),
        (("3.28e+04", "5"), ["32,800", "__,__5"]),
        ((r"$1.25\times10^{-3}$", "0.5"), ["0.00125", "0.5"]),
        ((r"$1.0\times10^{-9}$", "0", "-3"), ["_1.0e-09", "_0", "−3.0"]),
        (("0.5", r"$-2.5\times10^{-8}$"), ["_5.0e-01", "−2.5e-08"]),
        # other units are other columns' business
        (("3e-09 s", "12 m"), ["_3e-09 s", "12 m"]),
        # words, and what is no number, stay
        (("none", "7", "10", "–", ""), ["none", "_7", "10", "–", ""]),
        (("1, 2", "30"), ["1, 2", "30"]),
        (("2/3", "1"), ["2/3", "1"]),
        (("5.6, -11", "a-1", "16-bit"), ["5.6, −11", "a-1", "16-bit"]),
        (("-12 -11; -17 83", "5"), ["−12 −11; −17 83", "5"]),
        (
            ("7 km/s over the speed of light, as in flight", "1000 m"),
            ["7 km/s over the speed of light, as in flight", "1000 m"],
        ),
    ],
)
def test_a_page_aligns_the_numbers_of_a_column_in_one_notation(given, shown):
    found = column(*given)
    assert [cell.replace(",", "") for cell in found] == [cell.replace(",", "") for cell in shown]
    assert found == shown


def test_a_column_that_is_the_same_in_each_row_stands_below_the_table():
    body = (("a", "100", "1", "-2"), ("b", "100", "2", "-2"))
    table = Table("t", ("name", "trials", "found", "$x_1$"), body)
    assert table.page() == (
        "| name | found |\n| --- | --- |\n| a | 1 |\n| b | 2 |\n\nIn all rows: trials = 100; $x_1$ = −2."
    )
    assert table.markdown().count("100") == 2
    assert "In all rows" not in Table("t", ("name", "trials"), (("a", "100"), ("b", "100"))).page()
    assert "In all rows" not in Table("t", table.header, body[:1]).page()


def test_every_table_of_the_book_is_one_of_this_class():
    """No package writes the pipes of a table itself, and the stored tables are those of a page."""
    root = Path(__file__).resolve().parents[2]
    writers = [path.name for path in (root / "gpbnb").rglob("*.py") if '"---"' in path.read_text(encoding="utf-8")]
    assert writers == ["tables.py"]
    long = []
    for path in sorted((root / "book").glob("*.ipynb")):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            for output in cell.get("outputs", ()):
                text = "".join(output.get("data", {}).get("text/markdown", ""))
                if (rows := text.count("\n| ") - 1) > MOST_ROWS and "| --- |" in text:
                    long.append((path.stem, rows, "<details" in text))
    assert len(long) >= 3
    assert all(folded for *_, folded in long)
