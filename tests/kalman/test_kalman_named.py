"""gpbnb.filters.named: forms of the filter and roundings by name."""

from __future__ import annotations

import pytest

from gpbnb.filters.array_forms import ArrayForm
from gpbnb.filters.forms import Form
from gpbnb.filters.named import form_named

NAMES = {
    "innovation": Form.INNOVATION,
    "Joseph": Form.JOSEPH,
    "ud": Form.UD,
    "symmetrized": ArrayForm.SYMMETRIZED,
    "symmetrised": ArrayForm.SYMMETRIZED,
    "compensated": ArrayForm.COMPENSATED,
    "Potter": ArrayForm.POTTER,
    "Carlson": ArrayForm.CARLSON,
    "Cholesky": ArrayForm.CARLSON,
    "square root": ArrayForm.CARLSON,
    "square-root": ArrayForm.CARLSON,
    "hung": Form.HUNG,
    "Hung second gain": Form.HUNG_SECOND_GAIN,
}


@pytest.mark.parametrize(("name", "form"), NAMES.items())
def test_a_form_has_its_usual_names(name, form):
    assert form_named(name) is form
    assert form_named(f" {name.upper()} ") is form


@pytest.mark.parametrize("form", [*Form, *ArrayForm], ids=str)
def test_a_form_is_found_by_the_name_that_is_shown(form):
    assert form_named(str(form)) is form
