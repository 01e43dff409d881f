"""The ledger written out: CSV, and Markdown that renders; shown.txt has JSON and text."""

import csv
import io
import itertools
import re
from dataclasses import replace

import pytest
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

from gpbnb.report.ledger import Row, load_statements, table
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.render import to_csv
from gpbnb.report.ledger.statements import Statement

ENTRY = Statement("hung1984.II.eq20", "hung1984", "II", "6", "eq (20)", "equation", r"$|\tilde Q/Q|\le(n+m+1)\beta$")
FINDINGS = {
    "misprint": compare(False, r"$(n+m-1)\beta$", Verdict.MISPRINT, 'one "sign", \nas |(20)| of 1982'),
    "verified": compare(True, "yes"),
    "unverifiable": Finding("", None, Verdict.UNVERIFIABLE, "no data"),
    "answered": Finding("done", True, Verdict.ANSWERED, "here"),
}
ROWS = tuple(Row(ENTRY, finding) for finding in FINDINGS.values())
EVERYTHING = tuple(Row(entry, FINDINGS["misprint"]) for entry in load_statements())


def test_csv_is_rfc_4180_with_the_columns_of_the_contract():
    text = to_csv(ROWS)
    assert text.startswith("id,document,kind,printed,recomputed,agrees,verdict,note\r\n")
    assert text.endswith("\r\n")
    assert text.split("\r\n")[1] == (
        r"hung1984.II.eq20,hung1984,equation,$|\tilde Q/Q|\le(n+m+1)\beta$,$(n+m-1)\beta$,false,misprint,"
        '"one ""sign"", \nas |(20)| of 1982"'
    )
    records = list(csv.DictReader(io.StringIO(text, newline=""), strict=True))
    assert [record["agrees"] for record in records] == ["false", "true", "", "true"]
    assert [record["verdict"] for record in records] == [*FINDINGS]
    assert [record["note"] for record in records] == [f.note for f in FINDINGS.values()]
    assert {record["printed"] for record in records} == {ENTRY.printed}


def cells(line):
    return re.split(r"(?<!\\)\|", line)[1:-1]


def rendered(markdown):
    """Return the cells of the one table in `markdown`, each as (math texts, prose text)."""
    tokens = MarkdownIt("commonmark").enable("table").enable("strikethrough").use(dollarmath_plugin).parse(markdown)
    assert [token.type for token in tokens if token.level == 0] == ["table_open", "table_close"]
    found = []
    for before, token in itertools.pairwise(tokens):
        if before.type == "tr_open":
            found.append([])
        if token.type == "inline":
            assert {child.type for child in token.children} <= {"text", "text_special", "math_inline"}
            math = [child.content for child in token.children if child.type == "math_inline"]
            found[-1].append((math, "".join(child.content for child in token.children if child.type != "math_inline")))
    return found


@pytest.mark.parametrize(
    "prose", ["a*b*c", "u_j_k", "A~, b~_j ~~x~~", "[1] `x` <y> <https://z>", r"a\b", "#1 {x} |y| &lt;"]
)
def test_prose_is_not_markup(prose):
    entry = replace(ENTRY, item=prose, text=f"{prose} $x$ {prose}")
    _, body = rendered(table([Row(entry, FINDINGS["verified"])]).markdown())
    assert body[0] == ([], f"hung1984, II.6: {prose}")
    assert body[2] == (["x"], f"{prose}  {prose}")


def test_the_whole_inventory_makes_a_sound_table():
    markdown = table(EVERYTHING).markdown()
    lines = markdown.split("\n")
    assert len(lines) == len(EVERYTHING) + 2
    assert {len(cells(line)) for line in lines} == {5}
    _, *body = rendered(markdown)
    printed = {(row.statement.id, row.statement.printed) for row in EVERYTHING}
    assert len(body) == len(printed)
    prose = sorted("".join(text.split("$")[::2]) for _, text in printed)
    assert sorted(row[2][1] for row in body) == prose
    assert sum(len(row[2][0]) for row in body) == sum(text.count("$") // 2 for _, text in printed)
    assert not any("|" in math for row in body for math in row[2][0])
