"""What a user takes for granted in a first hour; tests/refused.txt has the mistakes."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    FixedFormat,
    FixedIntervalSmoother,
    LinearModel,
    LinearSystem,
    NonlinearModel,
    emulate,
    guarantee,
    limits,
    required_precision,
    write_code,
)

WALK = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
SYSTEM = LinearSystem([["0.9"]], [["0.1"]])


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
    with pytest.raises(OverflowError, match="coefficient high: got a result of about -2; needed one from -1"):
        emulate(LinearSystem.pid("0.4", "0.25", limits=(-3, -2)), [0.5], "Q15")
    assert guarantee(pid, words, limits(measurement=0.0625), horizon=9).bound[0] >= words.unit
    found = required_precision(pid, [0.25, -0.125, 0.5], 0.01, kind="fixed", like="Q15")
    assert found.met
    assert "high = 32767;" in write_code(pid, words, tmp_path)[1].read_text()


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
