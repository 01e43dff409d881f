"""Files and objects of other tools, and what the command writes about a run."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from scipy import io, signal

from gpbnb import emulate, read_model, required_precision
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.models import read_measurements

B, A = signal.butter(4, 0.1)
SOS = signal.butter(4, 0.1, output="sos")
WALK = "Phi = [[0.9]]\nH = [[1]]\nQ = [[0.01]]\nR = [[1]]\nx0 = [0]\nP0 = [[1]]\n"


def outputs(system):
    return system.outputs(np.eye(40, 1))[:, 0, 0]


@pytest.mark.parametrize(("entries", "design"), [({"b": B, "a": A}, (B, A)), ({"sos": SOS}, SOS)])
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".json"])
def test_a_filter_is_the_same_from_every_file_and_from_its_arrays(suffix, entries, design, tmp_path):
    path = tmp_path / f"low{suffix}"
    if suffix == ".npz":
        np.savez(path, **entries)
    elif suffix == ".mat":
        io.savemat(path, entries)
    else:
        path.write_text(json.dumps({key: value.tolist() for key, value in entries.items()}))
    expected = outputs(read_model({key: value.tolist() for key, value in entries.items()}))
    # JSON has decimals, which are read exactly, as those of TOML are.
    assert np.allclose(outputs(read_model(path)), expected, rtol=1e-9, atol=1e-12)
    assert np.array_equal(outputs(read_model(design)), expected)


def test_the_command_writes_a_run_and_keeps_quiet(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.toml").write_text(WALK)
    asked = ["walk.toml", "--tolerance", "0.01", "--steps", "30", "--basis", "emulation", "--csv", "run.csv"]
    assert main([*asked, "--quiet", "--seed", "3"]) == 0
    printed = capsys.readouterr()
    model = read_model(tmp_path / "walk.toml")
    answer = required_precision(model, 30, "0.01", seed=3)
    assert (printed.out, printed.err) == (f"{answer}\n", "")
    run = emulate(model, 30, answer.format, seed=3)
    rows = np.array(read_measurements(tmp_path / "run.csv"))
    assert np.array_equal(rows[:, 1:], np.hstack([run.x.to_float(), run.errors]))
    assert main(asked) == 0  # it may replace its own file
    assert "emulation" in capsys.readouterr().err
    (tmp_path / "run.csv").write_text("1\n")
    assert main(asked) == 2
    assert (
        "got --csv run.csv, and run.csv is a file that gpbnb has not written; needed another name"
        in capsys.readouterr().err
    )
    assert (tmp_path / "run.csv").read_text() == "1\n"


def test_a_filter_of_opencv_begins_with_its_last_estimate():
    given = type("KalmanFilter", (), {"__module__": "cv2"})()
    matrices = {
        "transitionMatrix": [[1, 0.5], [0, 1]], "measurementMatrix": [[1, 0]], "processNoiseCov": [[0.1, 0], [0, 0.2]],
        "measurementNoiseCov": [[0.3]], "errorCovPost": [[4, 1], [1, 5]], "statePost": [[1], [2]],
        "errorCovPre": [[9, 0], [0, 9]], "statePre": [[8], [8]], "controlMatrix": None,
    }  # fmt: skip
    vars(given).update({name: entries and np.array(entries) for name, entries in matrices.items()})
    found = read_model(given)
    entries = (each.astype(float).tolist() for each in (found.Phi[0], found.H[0], found.Q[0], found.R[0], found.P0))
    assert list(entries) == list(matrices.values())[:5]
    assert found.x0.tolist() == [1, 2]
    given.controlMatrix = np.ones((2, 1))
    with pytest.raises(ValueError, match="with a controlMatrix; needed none"):
        read_model(given)


def test_functions_of_a_file_are_those_of_python_and_leave_its_path(tmp_path):
    (tmp_path / "own.py").write_text("from constants import GAIN\n\ndef step(fmt, x, u):\n    return x + u / GAIN, x\n")
    (tmp_path / "constants.py").write_text("GAIN = 8\n")
    (tmp_path / "step.toml").write_text('step = "own.py:step"\nx0 = [0]\n')
    before, found = [*sys.path], read_model(tmp_path / "step.toml")
    assert sys.path == before
    again = read_model({"step": found.step, "x0": [0]})
    errors = [emulate(each, [0.3, 0.25], "Q3.12").errors.tolist() for each in (found, again)]
    assert errors[0] == errors[1] != [[0.0], [0.0]]
