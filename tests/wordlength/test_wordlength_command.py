"""gpbnb.wordlength.__main__, models and report: a model file in, an answer, a page and JSON out."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from markup import Elements

from gpbnb import required_precision
from gpbnb.bounds.check import prove
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.model import LinearModel
from gpbnb.wordlength import running as command
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
def files(tmp_path):
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    z = np.cumsum(np.random.default_rng(0).standard_normal(60)).round(3)
    z[7] = np.nan
    lines = ["range_m", *("" if math.isnan(each) else repr(float(each)) for each in z)]
    (tmp_path / "z.csv").write_text("\n".join(line or '""' for line in lines) + "\n", encoding="utf-8")
    return tmp_path, z.reshape(-1, 1)


def test_decimals_of_a_model_file_are_exact(files):
    model = read_model(files[0] / "model.toml")
    assert isinstance(model, LinearModel)
    assert model.Phi[0, 0, 1] == Fraction(1, 10)
    assert model.name == "tracker <1>"


def test_the_command_answers_and_writes_page_and_json(files, capsys):
    folder, z = files
    given = [str(folder / "model.toml"), "--measurements", str(folder / "z.csv"), "--tolerance", "0.01,inf"]
    assert main([*given, "--report", str(folder / "out.html")]) == 0
    expected = required_precision(read_model(folder / "model.toml"), z, (0.01, math.inf))
    shown = capsys.readouterr()
    assert shown.out.strip() == str(expected)
    assert "UD, bound: " in shown.err  # progress
    found = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert found["digits"] == expected.digits
    assert found["limiting"] == 0
    assert found["errors"][0] == pytest.approx(dict(expected.tried)[expected.digits])
    assert found["errors"][1] is None
    assert {each["label"] for each in found["answers"]} >= {"innovation, emulation", "UD, bound"}
    text = (folder / "out.html").read_text(encoding="utf-8")
    assert f"<strong>{expected.digits} bits</strong>" in text
    assert "tracker &lt;1&gt;" in text
    for outside in ("http://", "https://", "<script", "<link", "src="):
        assert outside not in text
    assert "--tolerance 0.01,inf" in text
    name, low, high = found["ranges"][0]
    written = [f"2{''.join('⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.index(sign)] for sign in str(k))}" for k in (low, high)]
    assert f"<td>{name}</td><td>{written[0]}</td><td>{written[1]}</td>" in text
    Elements(text)


def test_no_answer_has_an_exit_status_of_its_own(files, capsys):
    given = [str(files[0] / "model.toml"), "--tolerance", "1e-30", "--steps", "20", "--basis", "emulation"]
    assert main(given) == 1
    assert "no precision up to 53 bits" in capsys.readouterr().out


def test_a_guarantee_takes_limits_and_shows_them(files, capsys):
    folder = files[0]
    # With a precise sensor, the gain repeats soon.
    (folder / "model.toml").write_text(MODEL.replace("R = [[4]]", "R = [[0.01]]"), encoding="utf-8")
    given = [
        str(folder / "model.toml"),
        "--tolerance",
        "0.01,inf",
        "--steps",
        "50",
        "--report",
        str(folder / "out.html"),
    ]
    bases = ["--basis", "guarantee", "--basis", "probable"]
    assert main([*given, *bases, "--state", "1e4,50", "--innovation", "30"]) == 0
    model, within = read_model(folder / "model.toml"), limits(state=[1e4, 50], innovation=30)
    expected = required_precision(model, 50, (0.01, math.inf), basis="guarantee", within=within)
    probable = required_precision(model, 50, (0.01, math.inf), form="UD", basis="probable", within=within)
    assert capsys.readouterr().out.strip() == str(expected)
    found = json.loads((folder / "out.json").read_text(encoding="utf-8"))
    assert found["digits"] == expected.digits
    assert found["limits"] == {"state": [1e4, 50], "innovation": [30], "measurement": [None]}
    answers = {each["label"]: each["digits"] for each in found["answers"]}
    assert answers["innovation, guarantee"] == expected.digits
    assert answers["UD, probable"] == probable.digits
    text = (folder / "out.html").read_text(encoding="utf-8")
    assert "<td>limit on the state</td><td>10000, 50</td>" in text
    assert "<td>limit on the measurement</td><td>any</td>" in text
    assert "for all measurements within the limits" in text
    assert "holds for these measurements" not in text
    wider = [*given, "--basis", "guarantee", "--state", "1e8", "--innovation", "3e5"]
    assert main(wider) == 0
    assert json.loads((folder / "out.json").read_text(encoding="utf-8"))["digits"] > expected.digits


@pytest.mark.parametrize("form", ["innovation", "UD"])
def test_a_guarantee_comes_with_a_certificate(files, tmp_path, form, capsys):
    folder, path = files[0], tmp_path / "certificate.json"
    # With a precise sensor, the gain repeats soon.
    (folder / "model.toml").write_text(MODEL.replace("R = [[4]]", "R = [[0.01]]"), encoding="utf-8")
    given = [str(folder / "model.toml"), "--tolerance", "0.01,inf", "--certificate", str(path), "--form", form]
    sizes = ["--state", "1e4,50", "--innovation", "30"]
    assert main([*given, "--basis", "guarantee", *sizes]) == 0
    content = json.loads(path.read_text(encoding="utf-8"))
    prove(content)
    assert capsys.readouterr().out.startswith(f"{content['format']['precision']} bits")
    assert content["limits"] == {"state": ["10000", "50"], "innovation": ["30"], "measurement": [None]}
    assert Fraction(content["bound"][0]) <= Fraction("0.01")


def test_a_digital_filter_comes_with_a_certificate_and_code_of_the_file_as_it_was_read(tmp_path, capsys, monkeypatch):
    model, path, reads = tmp_path / "system.toml", tmp_path / "certificate.json", []
    monkeypatch.setattr(command, "read_filter", lambda *given: reads.append(given) or read_filter(*given))
    model.write_text('b = [0.1, 0.2, 0.1]\na = [1, -0.5, 0.3]\nstructure = "direct form I"\n', encoding="utf-8")
    given = [
        str(model),
        "--tolerance",
        "1e-3",
        "--basis",
        "guarantee",
        "--measurement",
        "2",
        "--certificate",
        str(path),
        "--code",
        str(tmp_path / "code"),
    ]
    assert main(given) == 0
    assert len(reads) == 1
    content = json.loads(path.read_text(encoding="utf-8"))
    assert "fixed coefficients" in prove(content)
    assert content["limits"]["measurement"] == ["2"]
    shown, bits = capsys.readouterr().out, content["format"]["precision"]
    assert bits != 24
    assert f"\ncertificate: {path}, for {bits} bits\ncode: " in shown
    assert "\nthe certificate does not cover this code, which is in BINARY32: add --format BINARY32 for" in shown
    assert main([*given, "--format", "BINARY32"]) == 0
    shown = capsys.readouterr().out
    assert f"\ncertificate: {path}, for BINARY32\ncode: " in shown
    assert "does not cover" not in shown
    assert json.loads(path.read_text(encoding="utf-8"))["format"]["precision"] == 24


def test_a_guarantee_refuses_measurements_with_gaps(files, capsys):
    """The gaps would become a part of the model that repeats for ever."""
    given = [str(files[0] / "model.toml"), "--tolerance", "0.01,inf", "--basis", "guarantee", "--measurement", "9"]
    assert main([*given, "--measurements", str(files[0] / "z.csv")]) == 2
    assert 'got missing measurements and basis "guarantee"; needed none: it does' in capsys.readouterr().err


def test_a_guarantee_for_a_system_takes_limits_on_the_measurement(tmp_path, capsys):
    path = tmp_path / "system.toml"
    path.write_text("A = [[0.5]]\nB = [[1]]\n", encoding="utf-8")
    given = [str(path), "--tolerance", "1e-4", "--basis", "guarantee", "--report", str(tmp_path / "out.html")]
    assert main([*given, "--measurement", "2"]) == 0
    expected = required_precision(read_model(path), 1000, 1e-4, basis="guarantee", within=limits(measurement=2))
    assert capsys.readouterr().out.strip() == str(expected)
    found = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert found["limits"]["measurement"] == [2]
    assert found["source"] == "none"
    for wrong in ([], ["--state", "1", "--innovation", "1"], ["--state", "1", "--measurement", "2"]):
        assert main([*given, *wrong]) == 2
        shown = capsys.readouterr().err
        assert "got --basis guarantee with" in shown
        assert "needed --measurement" in shown


def test_the_command_takes_known_inputs(files, capsys):
    folder, z = files[0], files[1][:9]
    (folder / "z.csv").write_text("\n".join((folder / "z.csv").read_text(encoding="utf-8").split("\n")[:10]))
    u = np.round(np.sin(np.arange(9) / 7), 3).reshape(-1, 1)
    (folder / "u.csv").write_text("push\n" + "\n".join(map(repr, u[:, 0].tolist())), encoding="utf-8")
    (folder / "model.toml").write_text(MODEL + "B = [[0.005], [0.1]]\nd = [0.5]\n", encoding="utf-8")
    given = [str(folder / "model.toml"), "--measurements", str(folder / "z.csv"), "--tolerance", "0.01,inf"]
    assert main([*given, "--inputs", str(folder / "u.csv"), "--basis", "emulation", "--form", "Cholesky"]) == 0
    model = read_model(folder / "model.toml", u)
    expected = required_precision(model, z, (0.01, math.inf), form="Cholesky")
    shown = capsys.readouterr()
    assert shown.out.strip() == str(expected)
    assert "Carlson, emulation: " in shown.err
    assert main(given) == 2
    assert "got B without u" in capsys.readouterr().err
