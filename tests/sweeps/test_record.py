"""gpbnb.sweeps.record and numbers: damaged records and numbers that only Python reads are refused."""

from __future__ import annotations

import pytest

from gpbnb.sweeps import Column, DamagedFileError, plain_number, read_record, write_record

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
