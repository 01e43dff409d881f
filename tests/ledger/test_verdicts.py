"""The stored verdicts are those that the checks find, and no check judges an altered statement right.

Each check depends on what the document prints.
"""

import csv
import os
import random
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from alterations import COMPARISON, altered
from test_answers import LEDGER, assert_stored

from gpbnb.report.ledger import TOPICS as EXAMINED
from gpbnb.report.ledger import Row, examine, judge, rows
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.corrections import load_corrections
from gpbnb.report.ledger.finding import DISAGREEMENTS, Verdict
from gpbnb.report.ledger.formula import Undefined, Words
from gpbnb.report.ledger.statements import load_statements
from gpbnb.report.ledger.stored import FILE, load_findings, to_table

CHECKED = {key: checks for checks in TOPICS.values() for key in checks}
MOST = 5 if os.environ.get("GPBNB_ALTERATIONS") == "more" else 3
"""Alterations judged of one statement; which ones depends on its id alone. `make exactness` judges more of them."""
MUST_HAVE_FORM = ("equation", "number", "example", "table")
"""Kinds of statements that must have a machine-readable form."""
LOST = {
    "hung1984.II.eq27": "the page is missing from the scan",
    "hung1982.II.table-ii-1": "the table is missing from the scan",
    "hung1982.III.s11-1.b-i-1-definition": "of the equation, the scan keeps one divisor",
    "hung1982.III.eq61": "the scan shows no legible part of the equation",
    "hung1982.III.eq97": "the scan has lost the sign that the equation is about",
}
"""Statements that the scan has lost, so that there is nothing to write down."""


@pytest.mark.parametrize("topic", EXAMINED)  # up to 11 s a topic, whose statements are all computed anew
def test_the_checks_of_a_topic_find_what_is_stored(topic):
    computed = examine([each for each in load_statements() if each.id in EXAMINED[topic]])
    stored = load_findings()
    assert len(computed) > 20
    assert [row for row in computed if row != Row(row.statement, stored.get(row.statement.id))] == [], (
        "if the new findings are right, run `make findings`"
    )


def test_the_true_values_are_those_that_are_stored():  # 5 s: some 240 domains
    assert_stored(*LEDGER)


def test_every_statement_has_a_stored_finding_and_nothing_else_is_stored():
    assert to_table(rows()) == FILE.read_text(encoding="utf-8")


def test_disagreements_have_a_note_and_comparisons_a_number():
    """No note says seven words twice, or those of the result, as one that is joined from wrong parts does."""
    for row in rows():
        note, recomputed = row.finding.note, row.finding.recomputed
        for text in (note, recomputed):
            assert text == " ".join(text.split()), row.statement.id
        words = note.split()
        runs = [" ".join(words[i : i + 7]) for i in range(len(words) - 6)]
        assert len(set(runs)) == len(runs), row.statement.id
        assert not any(run in recomputed for run in runs), row.statement.id
        assert note or row.finding.verdict is Verdict.VERIFIED, row.statement.id
        assert recomputed or row.finding.agrees is None, row.statement.id


def test_a_part_of_the_ledger_has_the_rows_of_that_part():
    part = rows(document="hung1984", chapter="II", sections=(2, 9))
    assert part == tuple(row for row in rows() if row in part) != ()
    assert {(row.statement.document, row.statement.chapter) for row in part} == {("hung1984", "II")}
    assert {row.statement.section.split(".")[0] for row in part} == {"2", "9"}


def test_twins_of_the_two_reports_with_one_form_have_the_same_verdict():
    verdicts = {row.statement.id: (row.statement.form, row.finding.verdict) for row in rows() if row.statement.form}
    twins = [(verdicts[key], verdicts.get(key.replace("hung1984.II.", "hung1982.III."))) for key in verdicts]
    same = [(one[1], other[1]) for one, other in twins if other is not None and other is not one and other[0] == one[0]]
    assert len(same) > 80
    assert all(one is other for one, other in same)


def until_violated(stated, domain, mode="exact"):
    """Judge a statement only up to the first instance that violates it: no check verifies it after that."""
    violated = []

    def held(parts, names, mode):
        found = HELD(parts, names, mode)
        violated.append(found[0] != names.get("holds", True))
        return found

    def instances():
        for names in [domain] if isinstance(domain, Mapping) else domain:
            yield names
            if any(violated):
                return

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(judge, "_held", held)
        return JUDGE(stated, instances(), mode)


HELD, JUDGE = judge._held, judge.judge


@pytest.fixture
def verdicts_alone(monkeypatch):
    """Leave notes as they are stored."""
    monkeypatch.setattr(judge, "judge", until_violated)
    monkeypatch.setattr(judge, "_filled", lambda text, names: text)


def still_true():
    """Alterations that leave a true statement, with the reason: (id, alteration) → why."""
    with Path(__file__).with_name("still_true.csv").open(newline="", encoding="utf-8") as file:
        return {(row["id"], row["alteration"]): row["why"] for row in csv.DictReader(file)}


STILL_TRUE = still_true()
STATEMENTS = load_statements()
CORRECTIONS = load_corrections()
CORRECTED = [
    corrected
    for each in STATEMENTS
    if each.id in CORRECTIONS and (corrected := CORRECTIONS[each.id].applied(each)) is not None
]
"""Statements as they should read."""
PRINTED = {each.id: each.form for each in STATEMENTS}


def listed(statement, name):
    """Whether an alteration is an exception; those of a corrected statement are listed as ``id corrected``."""
    key = statement.id if statement.form == PRINTED[statement.id] else f"{statement.id} corrected"
    return (key, name) in STILL_TRUE


def sameness(statement):
    """All that the verdict on a statement depends on; which of two documents prints it does not matter."""
    return CHECKED[statement.id][statement.id], statement.id.split(".", 2)[2], statement.form


def in_order(statement):
    """All alterations: the exceptions listed, then the others in an order that depends on the first copy's id alone.

    Two copies of a statement, in different documents, have the same order. Lower indices come last, where the others
    are too few.
    """
    every = dict(altered(statement))
    others = [name for name in every if not listed(statement, name)]
    random.Random(FIRST[sameness(statement)]).shuffle(others)
    others.sort(key=lambda name: "lower index" in name)
    exceptions = [name for name in every if listed(statement, name)]
    return {name: every[name] for name in (*exceptions, *others)}


def judged(statement):
    """The finding on a statement; that of a printed one is stored, and a copy of another is not judged again."""
    key = sameness(statement)
    if key not in FINDINGS:
        FINDINGS[key] = CHECKED[statement.id].run(statement)
    return FINDINGS[key]


@dataclass
class Trial:
    """How the check of a statement judges its alterations.

    Parameters
    ----------
    judged : verdict of each altered statement that has a meaning.
    undefined : alterations that name a quantity that does not exist, or combine quantities that do not fit.
    """

    judged: dict[str, Verdict]
    undefined: list[str]


def tried(statement, most=MOST):
    """Try `most` alterations besides the exceptions listed, and each one of a comparison."""
    trial = Trial({}, [])
    for name, other in in_order(statement).items():
        of_comparison = COMPARISON in name
        if of_comparison and judged(statement).verdict is not Verdict.VERIFIED:
            continue  # the sides of a wrong equation are unequal, so this alteration may well be right
        others = [each for each in trial.judged if COMPARISON not in each and not listed(statement, each)]
        if not of_comparison and len(others) >= most:
            continue
        try:
            trial.judged[name] = judged(other).verdict
        except Undefined:
            trial.undefined.append(name)
    return trial


def needed(statement):
    """The number of alterations that a check must judge: one negation of a claim in words, else three."""
    in_words = all(isinstance(part, Words) for part in statement.parts)
    return 1 if in_words and statement.kind not in MUST_HAVE_FORM else 3


TAKEN = [each for each in STATEMENTS if each.form and CHECKED[each.id][each.id].takes_statement]
"""Statements with a form that their checks judge."""
FINDINGS = {sameness(each): load_findings()[each.id] for each in TAKEN}
FIRST = {sameness(each): each.id for each in reversed([*TAKEN, *CORRECTED])}
for each in (TAKEN, CORRECTED):
    each.sort(key=lambda each: FIRST[sameness(each)])  # copies side by side, so that one process judges both


def of_topic(statements, topic):
    return [each for each in statements if each.id in TOPICS[topic]]


def assert_alterations_are_rejected(statement):
    """Enough alterations have a meaning, and of these only the exceptions listed are judged right."""
    trial = tried(statement)
    exceptions = {name for name in trial.judged if listed(statement, name)}
    right = {name for name, verdict in trial.judged.items() if verdict is Verdict.VERIFIED}
    assert right == exceptions, statement.id
    assert len(trial.judged) >= needed(statement), statement.id


def negations(statement):
    """For each claim in words, the statement with each of the other phrases."""
    forms = [part.text for part in statement.parts]
    for i, part in enumerate(statement.parts):
        if isinstance(part, Words):
            texts = [f"{part.label}: {other} | {part.printed}" for other in part.others]
            yield part.label, [replace(statement, form="; ".join([*forms[:i], t, *forms[i + 1 :]])) for t in texts]


@pytest.mark.usefixtures("verdicts_alone")
@pytest.mark.parametrize("topic", TOPICS)  # up to 4 s a topic: each statement is altered and judged
def test_no_altered_statement_is_judged_right(topic):
    for statement in of_topic(TAKEN, topic):
        verdict = judged(statement).verdict
        assert (verdict in DISAGREEMENTS) == (statement.id in CORRECTIONS), statement.id
        if verdict is not Verdict.GIVEN:  # of a definition, there is nothing to judge
            assert_alterations_are_rejected(statement)
        if verdict is Verdict.VERIFIED:
            for label, others in negations(statement):
                assert Verdict.VERIFIED not in {judged(other).verdict for other in others}, (statement.id, label)


@pytest.mark.usefixtures("verdicts_alone")
@pytest.mark.parametrize("topic", TOPICS)
def test_a_corrected_statement_is_judged_right_and_its_alterations_are_not(topic):
    for statement in of_topic(CORRECTED, topic):
        verdict = judged(statement).verdict
        assert verdict in (Verdict.VERIFIED, Verdict.GIVEN), statement.id
        if verdict is Verdict.VERIFIED:
            assert_alterations_are_rejected(statement)


def test_each_exception_is_an_alteration_with_its_reason():
    by_key = {each.id: each for each in STATEMENTS} | {f"{each.id} corrected": each for each in CORRECTED}
    alterations = {key: dict(altered(by_key[key])) for key in {key for key, _ in STILL_TRUE}}
    for (key, name), why in STILL_TRUE.items():
        assert why
        assert name in alterations[key], (key, name)


def test_each_equation_number_example_and_table_has_a_form():
    without = {statement.id for statement in STATEMENTS if statement.kind in MUST_HAVE_FORM and not statement.form}
    assert without == set(LOST)
    assert {judged(statement).verdict for statement in STATEMENTS if statement.id in LOST} == {Verdict.UNVERIFIABLE}


def test_each_statement_with_a_form_is_given_to_its_check():
    taken = {statement.id for statement in TAKEN}
    others = [statement for statement in STATEMENTS if statement.form and statement.id not in taken]
    assert {judged(statement).verdict for statement in others} == {Verdict.GIVEN, Verdict.UNVERIFIABLE}
