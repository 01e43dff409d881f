"""gpbnb.wordlength.__main__: what it writes beside an answer, which shown.txt has."""

from __future__ import annotations

import json

import numpy as np
import pytest
from markup import Elements

from gpbnb import required_precision
from gpbnb.wordlength import running
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_filter, read_model

MODEL = """
name = "tracker <1>"
Phi = [[1, 0.1], [0, 1]]
H = [[1, 0]]
Q = [[1e-4, 0], [0, 1e-2]]
R = [[4]]
x0 = [0, 0]
P0 = [[100, 0], [0, 100]]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a model."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    return tmp_path


def test_a_page_needs_no_network_and_json_has_the_errors(folder):
    z = np.cumsum(np.random.default_rng(0).standard_normal(60)).round(3)
    (folder / "z.csv").write_text("\n".join(map(repr, z.tolist())), encoding="utf-8")
    asked = "model.toml --measurements z.csv --tolerance 0.01,inf --basis emulation --report out.html"
    assert main(asked.split()) == 0
    expected = required_precision(read_model("model.toml"), z, ("0.01", np.inf))
    found = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert found["digits"] == expected.digits
    assert found["errors"] == [pytest.approx(dict(expected.tried)[expected.digits]), None]
    text = (folder / "out.html").read_text(encoding="utf-8")
    assert "tracker &lt;1&gt;" in text
    assert not any(outside in text for outside in ("http://", "https://", "<script", "<link", "src="))
    Elements(text)


def test_what_cannot_be_written_is_named(folder, capsys, monkeypatch):
    def full(*_):
        raise OSError("no space")

    monkeypatch.setattr(running, "replace_file", full)
    assert (
        main(["model.toml", "--tolerance", "1", "--steps", "20", "--basis", "emulation", "--csv", "run.csv", "--quiet"])
        == 2
    )
    expected = "python -m gpbnb.wordlength: got --csv run.csv, which could not be written: no space\n"
    assert capsys.readouterr().err == expected


def test_a_file_is_read_once(folder, monkeypatch):
    reads = []
    monkeypatch.setattr(running, "read_filter", lambda *given: reads.append(given) or read_filter(*given))
    (folder / "system.toml").write_text("A = [[0.5]]\nB = [[1]]\n", encoding="utf-8")
    assert (
        main(["system.toml", "--tolerance", "1e-3", "--basis", "guarantee", "--measurement", "2", "--code", "code"])
        == 0
    )
    assert len(reads) == 1
