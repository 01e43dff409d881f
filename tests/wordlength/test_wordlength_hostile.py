"""The command and its readers, given files and options that no friend would write: a message, never a traceback."""

from __future__ import annotations

import pytest

from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_model

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
