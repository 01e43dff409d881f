"""The statements and their corrections: what each row has, its text, and their selection."""

import re
from dataclasses import asdict

from gpbnb.report.ledger import load_statements
from gpbnb.report.ledger.corrections import load_corrections
from gpbnb.report.ledger.statements import DOCUMENTS, statement

INVENTORY = load_statements()


def test_each_statement_is_complete():
    assert len({entry.id for entry in INVENTORY}) == len(INVENTORY)
    for entry in INVENTORY:
        cells = asdict(entry)
        assert [name for name, cell in cells.items() if cell != cell.strip() or not (cell or name == "form")] == []
        assert entry.document in DOCUMENTS
        assert entry.kind in ("equation", "number", "example", "claim", "figure", "table", "open")
        assert entry.id.startswith(f"{entry.document}.")


def test_each_text_has_places_for_parts_of_its_form():
    corrected = [correction.applied(statement(key)) for key, correction in load_corrections().items()]
    for entry in (*INVENTORY, *filter(None, corrected)):
        assert set(re.findall(r"\{\{(\d+)\}\}", entry.text)) <= {str(k + 1) for k in range(len(entry.parts))}, entry.id
        assert markup_faults(entry.printed) == [], entry.id


def markup_faults(printed):
    parts = printed.split("$")
    if len(parts) % 2 == 0:
        return ["unpaired dollar sign"]
    faults = ["a LaTeX command outside of the math"] * any("\\" in prose for prose in parts[::2])
    for math in parts[1::2]:
        plain = re.sub(r"\\[{}]", "", math)
        faults += ["empty math, or blanks at its ends"] * (not math or math != math.strip())
        faults += ["unpaired brace"] * (plain.count("{") != plain.count("}"))
        faults += ["a LaTeX comment"] * ("%" in math.replace(r"\%", ""))
    return faults
