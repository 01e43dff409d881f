"""Mistakes of a first hour: each is refused in a line that says what came and what to do, or is no mistake at all."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from gpbnb import (
    BINARY16,
    BINARY32,
    FixedFormat,
    FixedIntervalSmoother,
    FloatFormat,
    LinearModel,
    LinearSystem,
    NonlinearModel,
    NonlinearSystem,
    emulate,
    guarantee,
    limit_cycles,
    limits,
    read_model,
    required_precision,
    survey_records,
    write_code,
)
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_measurements
from gpbnb.wordlength.required import judge

WALK = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
SYSTEM = LinearSystem([["0.9"]], [["0.1"]])
STEP = NonlinearSystem(lambda fmt, x, u: (x + u / 8, x), [0])
WITHIN = limits(measurement=0.001)
TOML = "Phi=[[1,1],[0,1]]\nH=[[1,0]]\nQ=[[1,0],[0,1]]\nR=[[1]]\nx0=[0,0]\nP0=[[1,0],[0,1]]\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(TOML)
    (tmp_path / "s.toml").write_text("A=[['0.9']]\nB=[['0.1']]\n")
    (tmp_path / "z.csv").write_text("1\n2\n3\n")
    (tmp_path / "timed.csv").write_text("t (s),z (m)\n0,1\n1,2\n2,3\n")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("m.toml --measurements timed.csv", "timed.csv: got 2 columns; needed 1, one for each measurement; remove "),
        ("s.toml --measurements timed.csv", "timed.csv: got 2 columns; needed 1, one for each input; remove others"),
        ("m.toml --measurements z.csv --steps 5", "z.csv: got 3 rows and --steps 5; needed one row for each step"),
        ("s.toml --measurements z.csv --steps 2", "z.csv: got 3 rows and --steps 2; needed one row for each step"),
        ("m.toml --report {long}.html", "got --report {long}.html, which cannot be written: File name too long"),
        (
            "m.toml --format binary128",
            "got --format BINARY128, which has no compiled loops; needed one of BINARY16, BINARY32",
        ),
        ("m.toml --form sqrt", "got form 'sqrt'; needed one of 'hung',"),
    ],
)
def test_a_command_is_refused(arguments, message, folder, capsys):
    long = "a" * 300
    assert main([*arguments.format(long=long).split(), "--tolerance", "1", "--basis", "emulation"]) == 2
    assert message.format(long=long) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"Phi": [[1, "0.1"], [0]]},
            r"Phi: got nested lists with parts of shapes \(1,\), \(2,\); needed parts",
        ),
        (
            {"outputs": ["y"]},
            r"outputs unknown; needed Phi, .* and perhaps B, u, .*, states, measurements, .* for a Kalman filter",
        ),
        ({"Phi": None, "phi": 1}, "needed Phi"),
    ],
)
def test_a_model_is_refused(given, message):
    entries = {"Phi": [[1, 1], [0, 1]], "H": [[1, 0]], "Q": np.eye(2), "R": [[1]], "x0": [0, 0], "P0": np.eye(2)}
    with pytest.raises((ValueError, TypeError), match=message):
        read_model({name: each for name, each in {**entries, **given}.items() if each is not None})


def test_one_measurement_needs_no_brackets():
    def bearing(x):
        return np.arctan2(x[1], x[0])

    noise = {"Q": np.eye(2) / 1024, "R": [["1/1024"]], "x0": [3, 1], "P0": np.eye(2)}
    one, row = (
        NonlinearModel(lambda x: x, None, h, None, **noise) for h in (bearing, lambda x: np.stack([bearing(x)]))
    )
    z = [0.375, 0.25, 0.3125]
    for method in ("float32", "Q3.20"):
        assert np.array_equal(emulate(one, z, method).errors, emulate(row, z, method).errors)
    smoothed = [FixedIntervalSmoother(WALK, z).run(BINARY32).x for z in (z, [[each] for each in z], np.array(z))]
    assert all((each == smoothed[0]).all() for each in smoothed)


def test_a_limit_beyond_the_data_is_their_last_number(tmp_path):
    """A PID controller limited to ±1 runs in Q15, whose numbers end below 1."""
    pid = LinearSystem.pid("0.4", "0.25", limits=(-1, 1))
    words = FixedFormat(0, 15, overflow="saturate")
    run = emulate(pid, [0.875] * 9, words)
    assert run.y.to_fractions().max() == 1 - words.unit == 1 - run.largest.max()
    assert emulate(pid, [-0.875] * 9, words).largest.max() < words.unit
    with pytest.raises(OverflowError, match="got high = -2, beyond the range"):
        emulate(LinearSystem.pid("0.4", "0.25", limits=(-3, -2)), [0.5], "Q15")
    assert guarantee(pid, words, limits(measurement=0.0625), horizon=9).bound[0] >= words.unit
    found = required_precision(pid, [0.25, -0.125, 0.5], 0.01, kind="fixed", like="Q15")
    assert found.met
    assert "high = 32767;" in write_code(pid, words, tmp_path)[1].read_text()


def test_a_call_is_refused():
    for call, message in [
        (lambda: guarantee(None, BINARY32, limits(state=1, innovation=1)), "got a NoneType; needed the path"),
        (lambda: guarantee(SYSTEM, 32, limits(measurement=1)), "got the format 32; needed a FloatFormat"),
        (lambda: guarantee(WALK, BINARY32, limits(measurement=1), horizon=0), "got horizon 0; needed a whole number"),
        (lambda: limits(state="a", innovation=1), "got 'a' on the state; needed one number for all"),
        (lambda: limits(state=[[1]], innovation=1), r"got limits of shape \(1, 1\) on the state; needed one number"),
        (lambda: survey_records(WALK, 3, 1, BINARY16, steps=5), "got formats FloatFormat.*; needed a list"),
        (lambda: survey_records(WALK, None, 1, [BINARY16]), "got records None; needed"),
        (lambda: emulate(SYSTEM, [1], 32), "got the format 32; needed a FloatFormat, a FixedFormat, WordFormats"),
        (lambda: write_code(SYSTEM, None, "code"), "got the format None; .*; an answer that is not met has no format"),
        (lambda: emulate(SYSTEM, [1], "float33"), "got format 'float33'; needed one of BINARY16"),
        (lambda: required_precision(SYSTEM, [1], 1, like="Q3.12"), 'kind="fixed" takes a FixedFormat'),
        (lambda: required_precision(SYSTEM, [1], 1, kind="fixed", like="float32"), "needed a FixedFormat or a name"),
        (lambda: required_precision(SYSTEM, [1], 1, kind="mixed"), "got kind 'mixed'; needed one of 'float', 'fixed'"),
        (lambda: required_precision(SYSTEM, "u.csv", 1), "got 'u.csv' for z; needed measurements or inputs"),
        (lambda: required_precision(3, [[1]], 1), "got a int; needed the path"),
        (
            lambda: required_precision(WALK, 5, np.ones((1000, 1))),
            r"^got a tolerance of shape \(1000, 1\); needed an error above 0 for each of the 1 states, one finite: one",
        ),
        (lambda: required_precision(WALK, 5, [1, 2]), r"^got tolerance \[1, 2\] of shape \(2,\); needed"),
        (lambda: required_precision(lambda: 1, 5, 1), "got a function that does not take .*fmt.*: .*; needed f.fmt."),
        (lambda: required_precision(lambda f, z: 1, 5, 1), "does not take .*; needed f.fmt., or inputs in place of"),
        # options that would change nothing, and counts beyond a limit
        (lambda: emulate(WALK, np.ones(9), "float32", seed=1), "got seed 1"),
        (lambda: required_precision(SYSTEM, np.ones(9), 0.1, seed=1), "got seed 1"),
        (lambda: required_precision(SYSTEM, np.ones(9), 0.1, kind="words", highest=9), "got highest=9"),
        (lambda: required_precision(WALK, 9, 0.1, kind="blocks", highest=9), "got highest=9"),
        (lambda: required_precision(WALK, 9, 0.1, kind="blocks", within=WITHIN), "got limits and"),
        (lambda: guarantee(SYSTEM, "float32", WITHIN, most=5), "got most=5"),
        (lambda: LinearSystem.sum(9, "tree", 4), "got block 4"),
        (
            lambda: NonlinearModel(abs, None, abs, None, [[1]], [[1]], [0], [[1]], points=(1, 2, 1)),
            "got points",
        ),
        (lambda: write_code(STEP, "float32", "code", within=WITHIN), "got limits"),
        (lambda: guarantee(WALK, "float32", WITHIN, most=10**12), "at most 1,000,000"),
        (lambda: limit_cycles(SYSTEM, "Q3.4", most=10**12), "at most 268,435,456"),
        (lambda: limit_cycles(SYSTEM, "Q3.4", [1, 2]), "got an input of shape"),
        (lambda: np.round(BINARY32.array([3]), 10**9), "at most 100,000"),
        (lambda: survey_records(WALK, 10**6, 0.1, ["float32"], steps=101), "at most 100"),
        *(
            (
                partial(answer, np.ones((5, 1)), 1, basis=basis, within=WITHIN),
                f'got limits and basis "{basis}", wh',
            )
            for model in (WALK, SYSTEM)
            for answer in (partial(required_precision, model), partial(judge, model, BINARY32))
            for basis in ("emulation", "bound")
        ),
        (
            lambda: required_precision(SYSTEM, 5, 1, basis="guarantee", within=limits(measurement=[1, 2])),
            "got 2 limits on the measurement; needed one, or 1",
        ),
        (
            lambda: required_precision(SYSTEM, 5, 1, basis="guarantee", within=limits(state=1, measurement=1)),
            r"got limits on states or innovations for .*; needed limits on its inputs alone: write limits\(meas",
        ),
        (
            lambda: read_model({"b": [1], "a": [1, "0.5"], "scale": True}),
            "got scale for 'direct form II transposed'; n",
        ),
        (lambda: LinearSystem.from_coefficients([1], [1, "0.5"], order=[0]), "got order for 'direct form II transpo"),
        (
            lambda: LinearSystem.from_sections([[1, 0, 0, 1, "0.5", 0]], "lattice", "given", scale=True),
            "got pairing and scale for 'lattice'; needed a cascade",
        ),
        (lambda: read_model(WALK, structure="cascade"), "got structure 'cascade' for a LinearModel, which is computed"),
        (lambda: read_model(SYSTEM, structure="cascade"), "got structure 'cascade' for a LinearSystem, which is comp"),
        (
            lambda: required_precision(SYSTEM, [[1]], 1, kind="fixed", rounding="chop", like=FixedFormat(2, 5)),
            "got rounding beside like; needed like alone, which sets them",
        ),
        (
            lambda: required_precision(SYSTEM, [[1]], 1, kind="fixed", coefficient_bits=9, like=FixedFormat(2, 5)),
            "got coefficient_bits beside like",
        ),
        # questions that would take days
        (
            lambda: survey_records(WALK, 10**12, 1, [BINARY16], steps=5),
            "records 1000000000000; needed .* at most 1,000,000",
        ),
        (
            lambda: NonlinearModel(abs, None, abs, None, [[1]], [[1]], [1], [[1]], iterations=10**9),
            "got iterations 1000000000; needed .* at most 1,000",
        ),
        (lambda: read_measurements("/dev/zero"), "zero: got more than 268,435,456 bytes; needed a shorter file"),
        (lambda: FloatFormat(2, 8, emin=-5, emax=5, subnormal="no"), "subnormal: got 'no'; needed True or False"),
    ]:
        with pytest.raises((ValueError, TypeError), match=message):
            call()


def test_an_answer_is_true_if_it_meets_the_tolerance():
    z = np.ones((5, 1))
    for tolerance, met in ((0.01, True), (1e-40, False)):
        answers = [
            required_precision(WALK, z, tolerance),
            judge(WALK, BINARY32, z, tolerance),
            required_precision(SYSTEM, z, tolerance, kind="fixed"),
            required_precision(WALK, z, tolerance, kind="blocks"),
            required_precision(SYSTEM, z, tolerance, kind="words"),
        ]
        assert [(bool(each), each.met) for each in answers] == [(met, met)] * 5


@pytest.mark.parametrize("name", ["filter.h", "filter.c", "test_filter.c", "filter_vectors.txt", "Makefile"])
def test_written_code_replaces_only_files_that_gpbnb_has_written(name, tmp_path):
    for _ in range(2):
        paths = write_code(SYSTEM, BINARY32, tmp_path)
    assert all(path.is_file() for path in paths)
    for path in paths:
        path.unlink()
    (tmp_path / name).write_text("my own\n")
    with pytest.raises(ValueError, match=f"in which {name} was not written by gpbnb; needed a folder without files"):
        write_code(SYSTEM, BINARY32, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "my own\n"
    write_code(SYSTEM, BINARY32, tmp_path, overwrite=True)
    assert (tmp_path / name).read_text() != "my own\n"


def test_an_overflow_names_the_numbers_that_are_too_large():
    with pytest.raises(OverflowError, match=r"^measurements: entry \[1, 0\]: got a result of about 2\*\*"):
        emulate(WALK, [[1], [1e6]], BINARY16)
    found = judge(WALK, BINARY16, [[1.0], [1e6]], 1)
    assert "measurements: entry [1, 0]: got a result" in str(found)
    large = LinearSystem([["0.5"]], [["0.25"]], C=[[3]], state_names=["level"])
    assert "got C1_1 = 3, beyond the range" in str(judge(large, FixedFormat(0, 15), [[0], [0]], 1))
    sections = LinearSystem.from_coefficients([1, 2, 1], [1, "-1.5", "0.75"])
    assert "got b1 = 2, beyond the range" in str(judge(sections, FixedFormat(0, 15), [[0], [0]], 1))
