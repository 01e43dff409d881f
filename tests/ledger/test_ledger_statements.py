"""The inventory: its reader, its selection, and the text itself."""

import csv
import hashlib
import io
import re
from pathlib import Path

import pytest

from gpbnb.ledger import load_inventory, quote, select
from gpbnb.ledger.statements import HEADER, Entry

HEAD = ",".join(HEADER)
GOOD = "hung1984.II.eq14,hung1984,II,4,eq (14),equation,$\\beta_c=2\\beta$"
INVENTORY = load_inventory()
CHANGES = Path(__file__).with_name("statement_changes.csv")


def inventory(tmp_path, *lines, encoding="utf-8"):
    path = tmp_path / "list.csv"
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def test_reads_what_is_written(tmp_path):
    quoted = 'savage2016.main.eq2,savage2016,-,analysis,"eq, (2)",claim,"a ""b"""'
    assert load_inventory(inventory(tmp_path, HEAD, GOOD, quoted)) == (
        Entry("hung1984.II.eq14", "hung1984", "II", "4", "eq (14)", "equation", "$\\beta_c=2\\beta$"),
        Entry("savage2016.main.eq2", "savage2016", "-", "analysis", "eq, (2)", "claim", 'a "b"'),
    )


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "line 1: the header is ''"),
        ([HEAD.replace("item", "name"), GOOD], "line 1: the header is 'id,document,chapter,section,name"),
        ([HEAD, GOOD, GOOD.replace("eq14", "eq15") + ",more"], "line 3: 8 fields; 7 are needed"),
        ([HEAD, "", GOOD], "line 2: 0 fields; 7 are needed"),
        ([HEAD, GOOD, GOOD], "line 3: id 'hung1984.II.eq14' is that of line 2 already"),
        ([HEAD, GOOD.replace("equation", "equations")], "line 2: unknown kind 'equations'; take one of equation,"),
        ([HEAD, GOOD.replace("hung1984", "hung1983")], "line 2: unknown document 'hung1983'; take one of hung1984,"),
        ([HEAD, GOOD.replace("hung1984.", "hung1982.")], "line 2: id 'hung1982.II.eq14' does not begin with its"),
        ([HEAD, GOOD.replace(",4,", ",,")], "line 2: section='' is blank"),
        ([HEAD, GOOD.replace(",4,", ", 4,")], "line 2: section=' 4' is blank or has blanks at an end"),
        ([HEAD, GOOD + "$"], "line 2: printed=.* has an unpaired or doubled dollar sign"),
        ([HEAD, GOOD.replace("$", "$$")], "line 2: printed=.* has an unpaired or doubled dollar sign"),
        ([HEAD, GOOD, '"open'], "line 3: unexpected end of data"),
    ],
)
def test_a_bad_line_is_named(tmp_path, lines, message):
    with pytest.raises(ValueError, match=f"list.csv, {message}"):
        load_inventory(inventory(tmp_path, *lines))


def test_a_quoted_line_break_counts_as_a_line(tmp_path):
    broken = 'hung1984.II.x,hung1984,II,4,x,claim,"a\n\nb"'
    with pytest.raises(ValueError, match="line 5: unknown kind"):
        load_inventory(inventory(tmp_path, HEAD, broken, GOOD.replace("equation", "x")))


def test_other_encodings_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"list\.csv is not UTF-8"):
        load_inventory(inventory(tmp_path, HEAD, GOOD + "é", encoding="latin-1"))


def test_a_missing_file_is_an_oserror(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_inventory(tmp_path / "none.csv")


def sections(entries):
    return list(dict.fromkeys((entry.document, entry.chapter, entry.section) for entry in entries))


def test_quotes_are_what_the_inventory_has():
    assert quote("hung1984.I.contract") == "the study was supported under contract NA58-34426"
    assert all(quote(entry.id) == entry.printed for entry in INVENTORY[::100])
    with pytest.raises(KeyError, match=r"no entry 'hung1984\.I\.none' in the inventory"):
        quote("hung1984.I.none")


def test_select_everything():
    assert select(INVENTORY) == INVENTORY


def test_select_by_each_filter():
    for field, value in (("document", "hung1982"), ("chapter", "III")):
        assert select(INVENTORY, **{field: value}) == tuple(e for e in INVENTORY if getattr(e, field) == value)
    both = select(INVENTORY, document="hung1984", chapter="III")
    assert both == tuple(e for e in INVENTORY if e.id.startswith("hung1984.III."))


def test_select_sections_takes_what_is_below_but_not_what_begins_alike():
    chosen = select(INVENTORY, "hung1984", "II", ["9", 1])
    assert sections(chosen) == [("hung1984", "II", "1"), ("hung1984", "II", "9.1"), ("hung1984", "II", "9.2")]
    assert select(INVENTORY, "hung1984", "II", "9.1") == tuple(e for e in chosen if e.section == "9.1")
    assert sections(select(INVENTORY, "hung1984", "II", "11")) == [
        ("hung1984", "II", f"11{part}") for part in ("", ".1", ".2", ".3", ".4")
    ]


@pytest.mark.parametrize(
    ("filters", "message"),
    [
        ({"document": "hung1983"}, "no entry of document 'hung1983'; here are: hung1984, hung1982, savage2016"),
        ({"document": "hung1984", "chapter": "IV"}, "no entry of chapter 'IV'; here are: I, II, III"),
        ({"chapter": "IV", "sections": [1]}, "no entry of section '1'; here are: -"),
        ({"document": "hung1984", "sections": ["9", "99"]}, "no entry of section '99'"),
        ({"sections": []}, "sections is empty"),
    ],
)
def test_an_empty_selection_is_refused(filters, message):
    with pytest.raises(ValueError, match=message):
        select(INVENTORY, **filters)


def changes():
    with CHANGES.open(newline="", encoding="utf-8") as file:
        return {record["id"]: record for record in csv.DictReader(file)}


def test_nothing_but_markup_and_the_listed_changes_differs_from_the_first_inventory():
    listed = changes()
    assert set(listed) <= {entry.id for entry in INVENTORY}
    first = io.StringIO(newline="")
    writer = csv.writer(first)
    writer.writerow(HEADER)
    for entry in INVENTORY:
        change = listed.get(entry.id, {"change": "markup", "before": entry.printed.replace("$", "")})
        if change["change"] != "added":
            writer.writerow(
                [entry.id, entry.document, entry.chapter, entry.section, entry.item, entry.kind, change["before"]]
            )
    digest = hashlib.sha256(first.getvalue().encode()).hexdigest()
    assert digest == "cd0d948fde4f0cd286e0ee754f5ca1276b5ceca3b979b98c5791b65300b1ed77"


def test_each_listed_change_changes_something_and_says_why():
    entries = {entry.id: entry for entry in INVENTORY}
    for key, change in changes().items():
        assert change["why"]
        assert change["change"] in {"corrected", "added"}
        assert entries[key].printed.replace("$", "") != change["before"]
        assert bool(change["before"]) == (change["change"] == "corrected")


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


def test_markup_is_sound():
    assert {entry.id: markup_faults(entry.printed) for entry in INVENTORY if markup_faults(entry.printed)} == {}


@pytest.mark.parametrize("printed", ["$a", r"\beta", "$$", "$ a$", r"$\frac{a$", "$1%$", r"$\{a}$"])
def test_unsound_markup_is_noticed(printed):
    assert len(markup_faults(printed)) == 1


@pytest.mark.parametrize(
    ("document", "chapter", "absent"),
    [("hung1984", "II", set()), ("hung1982", "III", set(range(5, 17)) | {30, 31})],
)
def test_each_numbered_equation_to_32_has_its_entry(document, chapter, absent):
    ids = {entry.id for entry in INVENTORY}
    assert {n for n in range(1, 33) if f"{document}.{chapter}.eq{n}" not in ids} == absent
    for first, last in ((5, 16), (30, 31)):
        if first in absent:
            assert f"{document}.{chapter}.eq{first}-{last}" in ids
