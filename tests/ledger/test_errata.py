"""The errata page: the picture of the argument, and root errors; answers.txt has a square for each statement."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import pytest

from gpbnb.report import ledger
from gpbnb.report.display import style
from gpbnb.report.ledger import argument, load_roots
from gpbnb.report.ledger.finding import Verdict


@pytest.fixture(scope="module")
def rows():
    return ledger.rows()


def test_the_parts_hold_every_wrong_statement(rows):
    found = argument.stages(rows)
    assert sum(stage.wrong for stage in found.values()) == sum(row.outcome == "wrong" for row in rows)
    assert found["integration"].documents == ("savage2016",)
    assert found["kalman"].documents == ("hung1982", "hung1984")
    assert all(0 <= stage.wrong <= stage.statements for stage in found.values())


def in_the_section_on_the_filter(row):
    """Equations from (97) on, and all else of section 12."""
    number = re.fullmatch(r"hung198[24]\.II?I?\.eq(\d+)\w*", row.statement.id)
    return int(number[1]) >= 97 if number else ".s12." in row.statement.id


def test_inherited_errors_are_those_of_roots_made_before_the_section_on_the_filter(rows):
    passed = argument.inherited(rows)
    of_root = {
        root: [row for row in spoiled if row.outcome == "wrong"] for root, spoiled in ledger.by_root(rows).items()
    }
    later = {root: sum(map(in_the_section_on_the_filter, spoiled)) for root, spoiled in of_root.items()}
    assert passed["kalman", "inversion"] == later["one-signed-epsilon"]
    assert passed["kalman", "rounding"] == later["product-error-relative-to-product"]
    assert ("inversion", "rounding") not in passed
    # Every arrow that passes something on is drawn.
    assert set(passed) <= set(argument.RESTS_ON)


def test_the_picture_follows_the_rule_of_figures_and_shows_the_counts(rows):
    figure = argument.figure(rows)
    figure.canvas.draw()
    assert style.defects(figure) == []
    texts = [text.get_text() for text in figure.axes[0].texts]
    for topic, stage in argument.stages(rows).items():
        assert f"{argument.NAMES[topic]}\n" in "".join(texts)
        assert any(f"{stage.statements} statements,\n{stage.wrong} wrong" in text for text in texts)
    assert all(str(count) in texts for count in argument.inherited(rows).values())
    plt.close(figure)
    html = argument.chain_of_errors(rows).html
    assert html == argument.chain_of_errors(rows).html
    assert html.startswith("<figure><img alt=")
    assert "data:image/svg+xml," in html


def test_each_wrong_statement_follows_from_a_root_error(rows):
    wrong = [row for row in rows if row.finding.verdict is Verdict.WRONG]
    assert [row.statement.id for row in wrong if row.finding.root not in load_roots()] == []


def test_each_root_error_makes_a_statement_wrong(rows):
    wrong = {row.finding.root for row in rows if row.finding.verdict is Verdict.WRONG}
    assert wrong == set(load_roots())
