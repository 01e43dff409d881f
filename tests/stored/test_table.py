"""gpbnb.report.stored_table: what is written is read again; damage is reported with its line and its cure."""

from __future__ import annotations

import pytest

from gpbnb.report.stored_table import Column, DamagedFileError, read, write

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
    assert {"command": CURE, "seed": "3", "rows": "45"}.items() < table.provenance.items()
    assert table.records(seed="3") == [{"kind": "a", "seed": "3", "error": "0.428571", "note": "", "limit": "inf"}]
    assert table.records(kind="a", seed="4") == []  # all values count


def test_every_lost_end_is_found(file):
    text = file.read_bytes()
    for length in range(len(text)):
        file.write_bytes(text[:length])
        with pytest.raises(DamagedFileError):
            read(file, COLUMNS, CURE)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"0.5714", b"0.5715", "line 3: the checksum of the rows is .*, not "),
        (b"# sha256", b"# other", "the checksum of the rows is .*, not None"),
        (b"kind,seed", b"seed,kind", "line 5: got the columns 'seed,kind,.*; needed 'kind,seed"),
        (b"# seed: 3", b"# \xff", r"year.csv, line 1: the file is not UTF-8.* Restore .* python -m something"),
    ],
)
def test_damage_is_described(file, old, new, message):
    file.write_bytes(file.read_bytes().replace(old, new))
    with pytest.raises(DamagedFileError, match=message):
        read(file, COLUMNS, CURE)


@pytest.mark.parametrize(
    ("column", "text", "fault"),
    [
        (COLUMNS[0], "c", "needed one of a, b, c"),
        (COLUMNS[1], "100", "needed 0 to 99"),
        (COLUMNS[1], "1.0", "needed an integer"),
        (COLUMNS[2], "-0.1", "needed 0 to 1e"),
        (COLUMNS[2], "nan", "needed 0 to 1e"),
        (COLUMNS[2], "", "needed a number"),
    ],
)
def test_values_out_of_range_are_neither_written_nor_read(tmp_path, column, text, fault):
    path = tmp_path / "year.csv"
    with pytest.raises(DamagedFileError, match="line 1: the file is missing"):
        read(path, [column], CURE)
    write(path, [Column(column.name, "text")], [(text,)], {})
    with pytest.raises(DamagedFileError, match=rf"line 4: got {column.name} = .*{fault}"):
        read(path, [column], CURE)
    with pytest.raises(ValueError, match=f"row 1: got {column.name} = .*{fault}"):
        write(path, [column], [(text,)], {})
