"""The command and its readers, given files and options that no friend would write: a message, never a traceback."""

from __future__ import annotations

import os

import pytest

from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_measurements, read_model

FILTER = {
    "Phi": "[[1, 0.1], [0, 1]]",
    "H": "[[1, 0]]",
    "Q": "[[1e-4, 0], [0, 1e-2]]",
    "R": "[[4]]",
    "x0": "[0, 0]",
    "P0": "[[100, 0], [0, 100]]",
}
SYSTEM = {"A": "[[0.5]]", "B": "[[1]]"}
INPUTS = FILTER | {"B": "[[1], [0]]", "u": "[[1], [2]]", "b": "[0, 0]", "d": "[0]", "steps": "2", "repair": "true"}


def toml(entries):
    return "".join(f"{key} = {value}\n" for key, value in entries.items())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "filter.toml").write_text(toml(FILTER), encoding="utf-8")
    (tmp_path / "system.toml").write_text(toml(SYSTEM), encoding="utf-8")
    (tmp_path / "z.csv").write_text("1\n2\n3\n", encoding="utf-8")
    (tmp_path / "folder").mkdir()
    return tmp_path


def refused(capsys, *arguments):
    """The message of a refusal, before which nothing was computed."""
    assert main([*arguments, "--tolerance", "0.1"]) == 2
    shown = capsys.readouterr()
    assert not shown.out
    *progress, message = shown.err.splitlines()
    assert progress == []
    assert message.startswith("python -m gpbnb.wordlength: ")
    return message.removeprefix("python -m gpbnb.wordlength: ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "model.toml: A, B missing; needed"),
        (b"\x00\xff\xfe", "model.toml, line 1: got the byte 0xff, which is not UTF-8; needed a file in UTF-8"),
        (toml(FILTER).encode() + b"\x00", "model.toml is not TOML: Invalid statement"),
        (toml(FILTER).encode() + b"R = [[3]]", "model.toml is not TOML: Cannot overwrite a value"),
        (b"A = " + b"[" * 5000 + b"]" * 5000, "model.toml is not TOML: its lists are nested too deeply"),
        (toml(FILTER | {"R": "[" * 60 + "4" + "]" * 60}).encode(), "model.toml: got R of shape (1, 1, 1, 1, "),
        (toml(FILTER | {"R": f"[[{'9' * 5000}]]"}).encode(), "model.toml is not TOML: Exceeds the limit"),
        (toml(FILTER | {"R": "[[1e99999999]]"}).encode(), "model.toml: R: entry 0, 0: got a number with the power of"),
        (toml(FILTER | {"R": f"[[1e{'9' * 40}]]"}).encode(), "model.toml: got an exponent that is too long"),
        (toml(FILTER | {"R": "[[1e9999]]"}).encode(), "got R with an entry near 2**33215; needed 2**-450 to 2**450"),
        (toml(FILTER | {"R": "[[nan]]"}).encode(), "model.toml: R: entry 0, 0: got NaN; needed a finite number"),
        ((toml(FILTER) + "[u]\na = 1").encode(), "model.toml: got u without B"),
        ((".".join("a" * 3000) + " = 1").encode(), "model.toml: A, B missing; a unknown"),
    ],
)
def test_a_model_file_that_is_none(folder, capsys, content, message):
    (folder / "model.toml").write_bytes(content)
    assert refused(capsys, "model.toml", "--measurements", "z.csv").startswith(message)


WRONG = {
    "truth": "true",
    "text": "'x'",
    "empty text": "''",
    "date": "1979-05-27",
    "table": "{a = 1}",
    "empty list": "[]",
    "empty row": "[[]]",
    "ragged": "[1, [2]]",
    "zero below": "[['1/0']]",
    "truths": "[[true]]",
    "dates": "[[1979-05-27]]",
    "tables": "[{a = 1}]",
    "large": "'1e99999999'",
    "float": "1e99",
}
# Every text is a name, and every truth value repairs or not.
ALLOWED = {("name", "text"), ("name", "empty text"), ("name", "large"), ("repair", "truth")}


@pytest.mark.parametrize(
    ("entries", "key"),
    [
        *((INPUTS, key) for key in (*INPUTS, "name")),
        *((SYSTEM, key) for key in (*SYSTEM, "C", "D", "x0", "name")),
        (SYSTEM, "unknown"),
    ],
)
def test_a_value_of_a_wrong_type_is_refused_with_its_key(folder, capsys, entries, key):
    for kind, value in WRONG.items():
        (folder / "model.toml").write_text(toml(entries | {key: value}), encoding="utf-8")
        if (key, kind) in ALLOWED:
            read_model(folder / "model.toml")
        else:
            message = refused(capsys, "model.toml", "--measurements", "z.csv")
            assert message.startswith("model.toml: "), kind
            assert key in message, kind


@pytest.mark.parametrize(
    ("report", "message"),
    [
        ("z.csv", "got z.csv and z.csv, which are one file"),
        ("data.html", "got data.json and data.json, which are one file"),
        ("linked.html", "got z.csv and linked.html, which are one file"),
        ("hard.html", "got z.csv and hard.html, which are one file"),
        ("a.json", "got --report a.json; needed the name of an HTML file"),
        ("", "got --report .; needed the name of an HTML file"),
        ("folder", "got --report folder, but folder is a folder"),
        ("absent/a.html", "got --report absent/a.html, but absent/a.html is in no folder that exists"),
        ("a" * 300, "File name too long"),
    ],
)
def test_a_report_over_a_file_that_is_read_is_refused_before_anything_is_computed(folder, capsys, report, message):
    (folder / "data.json").write_text("1\n2\n", encoding="utf-8")
    (folder / "linked.html").symlink_to("z.csv")
    os.link(folder / "z.csv", folder / "hard.html")
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    source = "data.json" if report == "data.html" else "z.csv"
    assert message in refused(capsys, "filter.toml", "--measurements", source, "--report", report)
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def test_a_report_may_replace_an_older_one_and_names_files_that_are_not_utf8(folder, capsys):
    name = os.fsdecode(b"z\xff.csv")
    (folder / "z.csv").rename(name)
    asked = ["filter.toml", "--tolerance", "0.1", "--basis", "emulation", "--measurements", name, "--report", "a.html"]
    for _ in range(2):
        assert main(asked) == 0
    assert r"z\xff.csv" in (folder / "a.html").read_text(encoding="utf-8")
    assert r"z\\xff.csv" in (folder / "a.json").read_text(encoding="utf-8")


def test_measurements_that_are_all_missing_leave_a_filter_at_zero(folder, capsys):
    (folder / "z.csv").write_text('nan\n""\n', encoding="utf-8")
    assert read_measurements("z.csv").shape == (2, 1)
    assert main(["filter.toml", "--tolerance", "0.1", "--basis", "emulation", "--measurements", "z.csv"]) == 0
    assert "observed in 2 steps" in capsys.readouterr().out
