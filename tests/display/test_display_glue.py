"""Stored numbers are those of every processor, and need no library that shows them."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from gpbnb.report.display import glue


@pytest.mark.parametrize(
    ("value", "stored"),
    [
        (0.639965805573098, "0.639966"),
        (0.639965805573101, "0.639966"),
        (np.float64(-1.23456789e-12), "-1.23457e-12"),
        (258595200.0, "258595200.0"),
        (np.float64(1.0), "1.0"),
        (math.inf, "inf"),
        (12345678, "12345678"),
        (True, "True"),
        ("1.23456789", "'1.23456789'"),
    ],
)
def test_a_float_is_stored_with_six_digits_and_a_whole_number_as_it_is(monkeypatch, value, stored):
    found = []
    monkeypatch.setattr(glue, "show", lambda data, **others: found.append((data, others)))
    glue.glue("x", value)
    glue.glue("x", value, display=True)
    (hidden, as_record), (shown, as_output) = found
    record = "application/papermill.record/"
    assert hidden[f"{record}text/plain"] == shown["text/plain"] == stored
    assert as_record["metadata"]["scrapbook"] == {"name": "x", "mime_prefix": record}
    assert as_output["metadata"]["scrapbook"] == {"name": "x", "mime_prefix": ""}


def test_the_record_is_that_of_myst_nb(monkeypatch):
    theirs = pytest.importorskip("myst_nb.ext.glue")
    found = []
    for module, name in ((glue, "show"), (theirs, "ipy_display")):
        monkeypatch.setattr(module, name, lambda *data, **others: found.append((data, others)))
        module.glue("x", 2.5, display=False)
    assert found[0] == found[1]


def test_nothing_of_the_book_is_needed():
    code = "import sys; sys.modules['myst_nb'] = None; from gpbnb.report.display.glue import glue; glue('x', 1.5)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
