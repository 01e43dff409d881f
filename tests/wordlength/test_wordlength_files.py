"""Files as spreadsheets and editors write them are read."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb import read_model
from gpbnb.wordlength.models import read_measurements

MODEL = 'name = "Füllstand °C"\nA = [[0.5]]\nB = [[1]]\n'


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("1\nNaN\n3\n", [[1], [math.nan], [3]]),
        ("1,NAN\nnan,2\n", [[1, math.nan], [math.nan, 2]]),
        ("tilt (°),°/s\n1,2\n", [[1, 2]]),
        ("°C,[m],(s),µm,%\n1,2,3,4,5\n", [[1, 2, 3, 4, 5]]),
        ("\ufefftilt\n1\n", [[1]]),
        ("\ufeff1\n2\n", [[1], [2]]),
        ("time,range\ns,m\n1,2\n", [[1, 2]]),
        (",range\n1,2\n", [[1, 2]]),
        ("# a remark\nrange\n\n1\n", [[1]]),
        ('"a, b",c\r\n1,\r\n,2\r\n', [[1, math.nan], [math.nan, 2]]),
        (" 1 , 2 \n", [[1, 2]]),
        ("# time; a remark\n1\n", [[1]]),
        ('"a; b",c\n1,2\n', [[1, 2]]),
        ("Na,K\n1,2\n", [[1, 2]]),
        # without the blank line, the last measurement would come a step early
        ("z\n1\n2\n\n3\n", [[1], [2], [math.nan], [3]]),
        ("\nz\n\n1\n\n\n2\r\n\r\n# a remark\n3\n\n\n", [[1], [math.nan], [math.nan], [2], [math.nan], [3]]),
        ('1\n\n""\n', [[1], [math.nan], [math.nan]]),
        ("1,2\n\n3,4\n\n", [[1, 2], [3, 4]]),
    ],
)
def test_measurements_are_read(text, rows, tmp_path):
    path = tmp_path / "z.csv"
    path.write_bytes(text.encode())
    np.testing.assert_array_equal(read_measurements(path), rows)


def test_a_model_file_may_begin_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "model.toml"
    path.write_bytes(MODEL.encode("utf-8-sig"))
    assert read_model(path).name == "Füllstand °C"
    path.write_bytes(MODEL.encode("latin-1"))
    with pytest.raises(
        ValueError, match=r"^model\.toml, line 1: got the byte 0xfc, which is not UTF-8; needed a file in"
    ):
        read_model(path)
    path.write_bytes(b"# one\n" + "# °\n".encode("latin-1"))
    with pytest.raises(ValueError, match=r"^model\.toml, line 2: got the byte 0xb0"):
        read_model(path)
