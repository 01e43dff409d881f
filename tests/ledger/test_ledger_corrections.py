"""The corrections: their reader, and what they correct."""

import pytest

from gpbnb.report.ledger import load_statements
from gpbnb.report.ledger.corrections import Correction, intended, load_corrections, read_corrections
from gpbnb.report.ledger.statements import Statement, statement

HEAD = "id,form,text,reason"
PRINTED = Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", "{{1}} [the scan is torn]", "a == b")


def corrections(tmp_path, *lines):
    path = tmp_path / "list.csv"
    path.write_text("\n".join((HEAD, *lines)) + "\n", encoding="utf-8")
    return read_corrections(path, {PRINTED.id: PRINTED})


def test_a_correction_replaces_the_form_and_where_it_must_the_text(tmp_path):
    form = corrections(tmp_path, "hung1984.II.x,a == c,,")["hung1984.II.x"].applied(PRINTED)
    assert form.printed == "$a=c$ [the scan is torn]"
    both = corrections(tmp_path, "hung1984.II.x,a == c,{{1}},")["hung1984.II.x"].applied(PRINTED)
    assert both.printed == "$a=c$"
    assert corrections(tmp_path, "hung1984.II.x,,,nobody knows")["hung1984.II.x"].applied(PRINTED) is None


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["hung1984.II.x,,,"], "needed a form, perhaps with a text, or else a reason"),
        (["hung1984.II.x,a == c,,why"], "needed a form, perhaps with a text, or else a reason"),
        (["hung1984.II.x,,{{1}},why"], "needed a form, perhaps with a text, or else a reason"),
        (["hung1984.II.y,a == c,,"], "a correction of 'hung1984.II.y' in list.csv; needed each id once"),
        (["hung1984.II.x,a == c,,", "hung1984.II.x,a == d,,"], "needed each id once"),
        (["hung1984.II.x,a == b,,"], "got the printed form as the correction of 'hung1984.II.x'"),
        (["hung1984.II.x,a == c,{{2}},"], r"got the place \{\{2\}\} in text; needed a number up to 1"),
        (["hung1984.II.x,a == c,$a,"], "unpaired or doubled dollar sign"),
        (["hung1984.II.x,a = c,,"], "needed a relation"),
    ],
)
def test_a_row_that_is_no_correction_is_refused(tmp_path, lines, message):
    with pytest.raises(ValueError, match=message):
        corrections(tmp_path, *lines)


def test_a_correction_needs_a_form_or_a_reason():
    with pytest.raises(ValueError, match="got form='', text='' and reason='' for x; needed a form"):
        Correction("x")


def test_what_was_intended_is_the_correction_or_else_the_print():
    assert intended("hung1984.II.eq81").form.endswith("*epsilon")
    assert intended("hung1984.II.eq82") == statement("hung1984.II.eq82")
    unknown = next(key for key, correction in load_corrections().items() if correction.reason)
    assert intended(unknown) == statement(unknown)
    with pytest.raises(KeyError, match="needed the id of a statement"):
        intended("hung1984.II.eq126")


def test_a_corrected_statement_does_not_speak_of_the_scan():
    by_id = {statement.id: statement for statement in load_statements()}
    corrected = [correction.applied(by_id[key]) for key, correction in load_corrections().items()]
    texts = {each.id: each.printed for each in corrected if each is not None}
    assert [key for key, text in texts.items() if any(word in text for word in ("scan", "OCR", "legible"))] == []


def test_a_corrected_statement_reads_otherwise():
    by_id = {statement.id: statement for statement in load_statements()}
    corrected = [correction.applied(by_id[key]) for key, correction in load_corrections().items()]
    assert [each.id for each in corrected if each is not None and each.printed == by_id[each.id].printed] == []
