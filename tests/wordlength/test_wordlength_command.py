"""gpbnb.wordlength.__main__, models and report: a model file in, an answer, a page and JSON out."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from markup import Elements

from gpbnb import FloatFormat, required_precision
from gpbnb.bounds.check import prove
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.settled import settled_filter
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.wordlength import running as command
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_filter, read_model
from gpbnb.wordlength.required import judge

MODEL = """
name = "tracker <1>"
Phi = [[1, 0.1], [0, 1]]
H = [[1, 0]]
Q = [[1e-4, 0], [0, 1e-2]]
R = [[4]]
x0 = [0, 0]
P0 = [[100, 0], [0, 100]]
"""
SETTLED = MODEL.replace("R = [[4]]", "R = [[0.01]]")
"""With a precise sensor, the gain repeats soon."""


@pytest.fixture
def files(tmp_path, monkeypatch):
    """The current folder, with a model, and its measurements, one of them missing."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(MODEL, encoding="utf-8")
    z = np.cumsum(np.random.default_rng(0).standard_normal(60)).round(3)
    z[7] = np.nan
    lines = ["range_m", *('""' if math.isnan(each) else repr(float(each)) for each in z)]
    (tmp_path / "z.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path, z.reshape(-1, 1)


def ask(words):
    return main(words.split())


def written(name="out.json"):
    with open(name, encoding="utf-8") as file:
        return json.load(file)


def test_the_command_answers_and_writes_page_and_json(files, capsys):
    folder, z = files
    asked = "model.toml --measurements z.csv --tolerance 0.01,inf --report out.html"
    assert ask(asked) == 0
    expected = required_precision(read_model("model.toml"), z, (0.01, math.inf))
    shown = capsys.readouterr()
    assert shown.out.strip() == str(expected)
    assert "UD, bound: " in shown.err  # progress
    found = written()
    assert (found["digits"], found["limiting"]) == (expected.digits, 0)
    assert found["errors"] == [pytest.approx(dict(expected.tried)[expected.digits]), None]
    assert {each["label"] for each in found["answers"]} >= {"innovation, emulation", "UD, bound"}
    text = (folder / "out.html").read_text(encoding="utf-8")
    assert f"<strong>{expected.digits} bits</strong>" in text
    assert "tracker &lt;1&gt;" in text
    assert not any(outside in text for outside in ("http://", "https://", "<script", "<link", "src="))
    assert "--tolerance 0.01,inf" in text
    name, *ends = found["ranges"][0]
    powers = [f"2{str(k).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}" for k in ends]
    assert f"<td>{name}</td><td>{powers[0]}</td><td>{powers[1]}</td>" in text
    Elements(text)


def test_no_answer_has_an_exit_status_of_its_own(files, capsys):
    assert ask("model.toml --tolerance 1e-30 --steps 20 --basis emulation --code code --csv run.csv") == 1
    shown = capsys.readouterr()
    assert "no precision up to 53 bits" in shown.out
    assert shown.err.endswith("gpbnb.wordlength: no code, since no format is known to meet the tolerance\n")
    assert not (files[0] / "code").exists()
    assert not (files[0] / "run.csv").exists()


def test_what_cannot_be_written_is_named(files, capsys, monkeypatch):
    def full(*_):
        raise OSError("no space")

    monkeypatch.setattr(command, "replace_file", full)
    assert ask("model.toml --tolerance 1 --steps 20 --basis emulation --csv run.csv --quiet") == 2
    expected = "python -m gpbnb.wordlength: got --csv run.csv, which could not be written: no space\n"
    assert capsys.readouterr().err == expected


def test_one_format_is_written_as_digits_base_and_rounding(files, capsys):
    given = "model.toml --measurements z.csv --tolerance 0.01 --basis emulation --quiet --digits 6"
    for options, fmt in (
        ("", FloatFormat(2, 6)),
        ("--base 10 --rounding chop --emin -9 --emax 9", FloatFormat(10, 6, "chop", emin=-9, emax=9)),
    ):
        expected = judge(read_model("model.toml"), fmt, files[1], 0.01)
        assert ask(f"{given} {options}") == 1 - expected.met
        assert capsys.readouterr().out.strip() == str(expected)


def test_a_constant_gain_makes_a_system_whose_inputs_the_filter_simulates(files, capsys):
    (files[0] / "model.toml").write_text(SETTLED, encoding="utf-8")
    given = ["model.toml", "--tolerance", "0.01,0.1", "--basis", "emulation", "--quiet", "--form", "constant gain"]
    assert main([*given, "--steps", "40", "--seed", "5"]) == 0
    model = read_model("model.toml")
    expected = required_precision(settled_filter(model), simulated_measurements(model, 40, 5), (0.01, 0.1))
    assert capsys.readouterr().out.strip() == str(expected)


def test_a_guarantee_takes_limits_shows_them_and_comes_with_a_certificate(files, capsys):
    folder = files[0]
    (folder / "model.toml").write_text(SETTLED, encoding="utf-8")
    given = "model.toml --tolerance 0.01,inf --steps 50 --report out.html --basis guarantee"
    sizes = "--state 1e4,50 --innovation 30"
    assert ask(f"{given} --basis probable {sizes} --certificate proof.json") == 0
    asked = {"tolerance": (0.01, math.inf), "within": limits(state=[1e4, 50], innovation=30)}
    expected, probable = (
        required_precision(read_model("model.toml"), 50, form=form, basis=basis, **asked)
        for form, basis in (("innovation", "guarantee"), ("UD", "probable"))
    )
    assert capsys.readouterr().out.startswith(str(expected))
    found = written()
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
    content = written("proof.json")
    prove(content)
    assert content["format"]["precision"] == expected.digits
    assert content["limits"] == {"state": ["10000", "50"], "innovation": ["30"], "measurement": [None]}
    assert Fraction(content["bound"][0]) <= Fraction("0.01")


def test_a_digital_filter_comes_with_a_certificate_and_code_of_the_file_as_it_was_read(files, capsys, monkeypatch):
    reads = []
    monkeypatch.setattr(command, "read_filter", lambda *given: reads.append(given) or read_filter(*given))
    text = 'b = [0.1, 0.2, 0.1]\na = [1, -0.5, 0.3]\nstructure = "direct form I"\n'
    (files[0] / "system.toml").write_text(text, encoding="utf-8")
    given = "system.toml --tolerance 1e-3 --basis guarantee --measurement 2 --certificate proof.json --code code"
    assert ask(given) == 0
    assert len(reads) == 1
    content = written("proof.json")
    assert "fixed coefficients" in prove(content)
    assert content["limits"]["measurement"] == ["2"]
    shown, bits = capsys.readouterr().out, content["format"]["precision"]
    assert bits != 24
    assert f"\ncertificate: proof.json, for {bits} bits\ncode: " in shown
    assert "\nthe certificate does not cover this code, which is in BINARY32: add --format BINARY32 for" in shown
    assert ask(f"{given} --format BINARY32") == 0
    shown = capsys.readouterr().out
    assert "\ncertificate: proof.json, for BINARY32\ncode: " in shown
    assert "does not cover" not in shown
    assert written("proof.json")["format"]["precision"] == 24


def test_a_guarantee_for_a_system_takes_limits_on_the_measurement(files, capsys):
    (files[0] / "system.toml").write_text("A = [[0.5]]\nB = [[1]]\n", encoding="utf-8")
    assert ask("system.toml --tolerance 1e-4 --basis guarantee --report out.html --measurement 2") == 0
    expected = required_precision(read_model("system.toml"), 1, 1e-4, basis="guarantee", within=limits(measurement=2))
    assert capsys.readouterr().out.strip() == str(expected)
    assert (written()["limits"]["measurement"], written()["source"]) == ([2], "none")


def test_the_command_takes_known_inputs(files, capsys):
    folder, z = files
    (folder / "z.csv").write_text("\n".join((folder / "z.csv").read_text(encoding="utf-8").split("\n")[:10]))
    u = np.round(np.sin(np.arange(9) / 7), 3).reshape(-1, 1)
    (folder / "u.csv").write_text("push\n" + "\n".join(map(repr, u[:, 0].tolist())), encoding="utf-8")
    (folder / "model.toml").write_text(MODEL + "B = [[0.005], [0.1]]\nd = [0.5]\n", encoding="utf-8")
    given = "model.toml --measurements z.csv --tolerance 0.01,inf --basis emulation"
    assert ask(f"{given} --inputs u.csv --form Cholesky") == 0
    expected = required_precision(read_model("model.toml", u), z[:9], (0.01, math.inf), form="Cholesky")
    shown = capsys.readouterr()
    assert shown.out.strip() == str(expected)
    assert "Carlson, emulation: " in shown.err
    assert ask(given) == 2
    assert "got B without u" in capsys.readouterr().err
