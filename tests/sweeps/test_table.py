"""Tables and records: what is written is read again; damage is reported with its line and its cure."""

from __future__ import annotations

import pytest

from gpbnb.sweeps import Column, DamagedFileError, plain_number, read, read_record, write, write_record

COLUMNS = (
    Column("kind", "text", choices=("a", "b, c")),
    Column("seed", "integer", 0, 99),
    Column("error", low=0, high=1e6),
    Column("note", "text", optional=True),
    Column("limit", low=0, optional=True),
)
ROWS = tuple(("a" if i % 2 else "b, c", str(i), f"{i / 7:.6g}", "", "inf" if i == 3 else "") for i in range(45))
CURE = "python -m something"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "year.csv"
    write(path, COLUMNS, ROWS, {"command": CURE, "seed": "3"})
    return path


def test_what_is_written_is_read(file):
    table = read(file, COLUMNS, CURE)
    assert table.rows == ROWS
    assert {key: table.provenance[key] for key in ("command", "seed", "rows")} == {
        "command": CURE,
        "seed": "3",
        "rows": "45",
    }
    assert table.records(seed="3") == [{"kind": "a", "seed": "3", "error": "0.428571", "note": "", "limit": "inf"}]
    assert len(table.records(kind="a")) == 22
    assert table.records(kind="a", seed="4") == []  # all values count


def test_every_lost_end_is_found(file):
    text = file.read_bytes()
    for length in range(len(text)):
        file.write_bytes(text[:length])
        with pytest.raises(DamagedFileError):
            read(file, COLUMNS, CURE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: [*lines[:27], ""], "line 28: the file ends after 22 of 45 rows"),
        (lambda lines: lines[:9] + lines[10:], "line 50: the file ends after 44 of 45 rows"),
        (lambda lines: [*lines[:-1], lines[-2], ""], "line 51: the file has more than the 45 rows"),
        (lambda lines: [*lines[:6], lines[6].replace(",", ";"), *lines[7:]], "line 7: got 1 fields; needed 5"),
        (lambda lines: [*lines[:7], lines[7].replace("2,0.28", "2,-0.28"), *lines[8:]], "line 8: got error = '-0.28"),
        (lambda lines: [line for line in lines if "rows" not in line], "the line '# rows: …' is missing"),
        (lambda lines: [lines[0], lines[0], *lines[1:]], "line 2: .* each key once"),
        (
            lambda lines: [line.replace("kind,seed", "seed,kind") for line in lines],
            "line 5: got the columns 'seed,kind,.*; needed 'kind,seed",
        ),
        (
            lambda lines: [*lines[:9], lines[9].replace("0.5714", "0.5715"), *lines[10:]],
            "line 3: the checksum .* differs",
        ),
        (lambda lines: [line for line in lines if "sha256" not in line], "the checksum of the rows is .*, not None"),
        (lambda lines: [], "line 1: the line '# rows: …' is missing"),
    ],
)
def test_damage_is_described(file, change, message):
    file.write_bytes("\n".join(change(file.read_text(encoding="utf-8").split("\n"))).encode())
    with pytest.raises(DamagedFileError, match=message):
        read(file, COLUMNS, CURE)


def test_a_missing_and_a_foreign_file_are_reported(tmp_path):
    with pytest.raises(DamagedFileError, match=r"csv, line 1: the file is missing. Restore .* python -m something"):
        read(tmp_path / "year.csv", COLUMNS, CURE)
    (tmp_path / "year.csv").write_bytes(b"\xff\xfe")
    with pytest.raises(DamagedFileError, match="not UTF-8"):
        read(tmp_path / "year.csv", COLUMNS, CURE)


@pytest.mark.parametrize(
    ("column", "text", "fault"),
    [
        (COLUMNS[0], "c", "needed one of a, b, c"),
        (COLUMNS[1], "100", "needed 0 to 99"),
        (COLUMNS[1], "1.0", "needed an integer"),
        (COLUMNS[2], "-0.1", "needed 0 to 1e"),
        (COLUMNS[2], "nan", "needed 0 to 1e"),
        (COLUMNS[2], "", "needed a number"),
        (COLUMNS[2], "one", "needed a number"),
    ],
)
def test_values_out_of_range_are_neither_written_nor_read(tmp_path, column, text, fault):
    path = tmp_path / "year.csv"
    write(path, [Column(column.name, "text")], [(text,)], {})
    with pytest.raises(DamagedFileError, match=rf"line 4: got {column.name} = .*{fault}"):
        read(path, [column], CURE)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=f"row 1: got {column.name} = .*{fault}"):
        write(path, [column], [(text,)], {})
    assert path.read_bytes() == before


VALUES = {"command": "python -m x", "seconds": 1.5, "names": ["é", "b"], "nothing": None}


def test_a_record_is_read_as_it_was_written(tmp_path):
    write_record(tmp_path / "a.json", VALUES)
    assert read_record(tmp_path / "a.json", "cure") == VALUES


def test_every_damage_of_a_record_is_an_error_with_file_and_cure(tmp_path):
    file = tmp_path / "a.json"
    write_record(file, VALUES)
    good = file.read_bytes()
    for at in range(len(good) - 1):  # a record cut anywhere
        file.write_bytes(good[:at])
        with pytest.raises(DamagedFileError, match=r"a.json, line \d+: .*python -m cure"):
            read_record(file, "python -m cure")
    for old, new in (("1.5", "1.25"), ("python -m x", "python -m y"), ('"b"', '"b", "c"')):
        file.write_bytes(good.replace(old.encode(), new.encode()))
        with pytest.raises(DamagedFileError, match="checksum"):
            read_record(file, "python -m cure")
    file.unlink()
    with pytest.raises(DamagedFileError, match="missing"):
        read_record(file, "python -m cure")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00\xff",
        b"\xef\xbb\xbf{}",
        b"[1, 2]",
        b"[" * 100_000,
        b'{"a": ' + b"9" * 5000 + b"}",
        b'{"sha256": 3, "name": "\\ud800"}',
    ],
    ids=["empty", "binary", "marked", "list", "nested", "huge", "surrogate"],
)
def test_a_foreign_file_is_a_damaged_record(content, tmp_path):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(DamagedFileError, match=r"a.json, line 1: .*compute it again: python -m cure"):
        read_record(tmp_path / "a.json", "python -m cure")


@pytest.mark.parametrize("text", ["1_0", "٣", "", " 1", "1 ", "1e999", "-1e999", "0x1", "1e", ".", "--1", "infinity"])
def test_what_is_no_plain_number(text):
    with pytest.raises(ValueError, match="needed"):
        plain_number(text)
    assert Column("a").fault(text)
    assert Column("a", "integer").fault(text)
