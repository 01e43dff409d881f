"""gpbnb.wordlength.report: what a study knows of its question; shown.txt has the pages."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FixedFormat
from gpbnb.filters.poles import stored_response
from gpbnb.wordlength.models import read_filter
from gpbnb.wordlength.report import Question, study


@pytest.mark.parametrize(
    ("asked", "stored", "shortest"),
    [
        ({}, "{} bits", "fewest digits: balanced state space, 9 bits"),
        ({"kind": "fixed"}, "15 significant bits", "shortest: balanced state space, word of 10 bits"),
        ({"kind": "fixed", "fmt": FixedFormat(2, 12)}, "15-bit fixed point (12 fraction bits)", ""),
        ({"kind": "words"}, "9 significant bits", ""),  # another structure has as many bits
    ],
)
def test_what_storing_does_to_a_filter_is_told_with_the_format_of_its_coefficients(asked, stored, shortest):
    source = read_filter({"b": ["0.1", "0.2", "0.1"], "a": [1, "-1.2", "0.5"], "structure": "direct form I"})
    question = Question(source, "0.01", z=np.sin(np.arange(60) / 3)[:, None], bases=("emulation",), **asked)
    found = study(question)
    change = stored_response(source.model, found.answer.format)._replace(format=stored.format(found.answer.digits))
    assert found.entries["stored"] == str(change)
    assert found.entries["shortest"].partition(" (structure")[0] == shortest
