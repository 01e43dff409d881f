"""The inventory: its reader, its selection, and the text itself."""

import re

import pytest

from gpbnb.report.ledger import load_statements, quote, select
from gpbnb.report.ledger.statements import HEADER, Statement

HEAD = ",".join(HEADER)
GOOD = "hung1984.II.eq14,hung1984,II,4,eq (14),equation,$\\beta_c=2\\beta$,"
INVENTORY = load_statements()


def inventory(tmp_path, *lines, encoding="utf-8"):
    path = tmp_path / "list.csv"
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def test_reads_what_is_written(tmp_path):
    quoted = 'savage2016.main.eq2,savage2016,-,analysis,"eq, (2)",claim,"a ""b""",'
    assert load_statements(inventory(tmp_path, HEAD, GOOD, quoted)) == (
        Statement("hung1984.II.eq14", "hung1984", "II", "4", "eq (14)", "equation", "$\\beta_c=2\\beta$"),
        Statement("savage2016.main.eq2", "savage2016", "-", "analysis", "eq, (2)", "claim", 'a "b"'),
    )


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "line 1: got the header ''"),
        ([HEAD.replace("item", "name"), GOOD], "line 1: got the header 'id,document,chapter,section,name"),
        ([HEAD, GOOD, GOOD.replace("eq14", "eq15") + ",more"], "line 3: got 9 fields; needed 8"),
        ([HEAD, "", GOOD], "line 2: got 0 fields; needed 8"),
        ([HEAD, GOOD, GOOD], "line 3: got id 'hung1984.II.eq14', which line 2 has already"),
        ([HEAD, GOOD.replace("equation", "equations")], "line 2: got kind 'equations'; needed one of equation,"),
        ([HEAD, GOOD.replace("hung1984", "hung1983")], "line 2: got document 'hung1983'; needed one of hung1984,"),
        (
            [HEAD, GOOD.replace("hung1984.", "hung1982.")],
            "line 2: got id 'hung1982.II.eq14'; needed an id that begins with its",
        ),
        ([HEAD, GOOD.replace(",4,", ",,")], "line 2: got section=''; needed a text without"),
        (
            [HEAD, GOOD.replace(",4,", ", 4,")],
            "line 2: got section=' 4'; needed a text without leading or trailing blanks",
        ),
        ([HEAD, GOOD[:-1] + "$,"], "line 2: got text=.* with an unpaired or doubled dollar sign"),
        ([HEAD, GOOD.replace("$", "$$")], "line 2: got text=.* with an unpaired or doubled dollar sign"),
        ([HEAD, GOOD, '"open'], "line 3: unexpected end of data"),
    ],
)
def test_a_bad_line_is_named(tmp_path, lines, message):
    with pytest.raises(ValueError, match=f"list.csv, {message}"):
        load_statements(inventory(tmp_path, *lines))


def test_a_quoted_line_break_counts_as_a_line(tmp_path):
    broken = 'hung1984.II.x,hung1984,II,4,x,claim,"a\n\nb",'
    with pytest.raises(ValueError, match="line 5: got kind"):
        load_statements(inventory(tmp_path, HEAD, broken, GOOD.replace("equation", "x")))


def test_other_encodings_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"list\.csv, which is not UTF-8"):
        load_statements(inventory(tmp_path, HEAD, GOOD[:-1] + "é,", encoding="latin-1"))


def test_a_missing_file_is_an_oserror(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_statements(tmp_path / "none.csv")


def sections(entries):
    return list(dict.fromkeys((entry.document, entry.chapter, entry.section) for entry in entries))


def test_quotes_are_what_the_inventory_has():
    assert quote("hung1984.I.contract") == "the study was supported under contract NA58-34426"
    assert all(quote(entry.id) == entry.printed for entry in INVENTORY[::100])
    with pytest.raises(KeyError, match=r"'hung1984\.I\.none'; needed the id of a statement"):
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
    assert sections(chosen) == [("hung1984", "II", part) for part in ("1", "9", "9.1", "9.2")]
    assert select(INVENTORY, "hung1984", "II", "9.1") == tuple(e for e in chosen if e.section == "9.1")
    assert sections(select(INVENTORY, "hung1984", "II", "11")) == [
        ("hung1984", "II", f"11{part}") for part in ("", ".1", ".2", ".3", ".4")
    ]


@pytest.mark.parametrize(
    ("filters", "message"),
    [
        (
            {"document": "hung1983"},
            "got document 'hung1983', which no entry has; needed one of hung1984, hung1982, savage2016",
        ),
        ({"document": "hung1984", "chapter": "IV"}, "got chapter 'IV', which no entry has; needed one of -, I, II"),
        ({"chapter": "IV", "sections": [1]}, "got section '1', which no entry has; needed one of -"),
        ({"document": "hung1984", "sections": ["9", "99"]}, "got section '99', which no entry has"),
        ({"sections": []}, "got an empty sections"),
    ],
)
def test_an_empty_selection_is_refused(filters, message):
    with pytest.raises(ValueError, match=message):
        select(INVENTORY, **filters)


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


@pytest.mark.parametrize(("document", "chapter"), [("hung1984", "II"), ("hung1982", "III")])
def test_each_numbered_equation_has_its_entry(document, chapter):
    """No entry holds several of them; (89) of 1982 has one for each of its two forms."""
    places = [entry.id.removeprefix(f"{document}.{chapter}.") for entry in INVENTORY]
    numbers = [int(place[2:]) for place in places if re.fullmatch(r"eq\d+", place)]
    forms_of_89 = [89] * ("eq89-first-form" in places and "eq89-factored-form" in places)
    assert sorted(numbers + forms_of_89) == list(range(1, 126))


def test_no_entry_names_several_equations_or_examples():
    named = re.compile(r"\beqs |\b[Ee]xamples |, ?[ab]\d|,.*,")
    kinds = ("equation", "example")
    assert [entry.id for entry in INVENTORY if entry.kind in kinds and named.search(entry.item)] == []
