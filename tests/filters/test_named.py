"""gpbnb.filters.named: forms of the filter and roundings by name."""

from __future__ import annotations

import pytest

from gpbnb.filters.forms import Form, form_named

NAMES = {
    "innovation": Form.INNOVATION,
    "Joseph": Form.JOSEPH,
    "ud": Form.UD,
    "symmetrized": Form.SYMMETRIZED,
    "symmetrised": Form.SYMMETRIZED,
    "compensated": Form.COMPENSATED,
    "Potter": Form.POTTER,
    "Carlson": Form.CARLSON,
    "Cholesky": Form.CARLSON,
    "square root": Form.CARLSON,
    "square-root": Form.CARLSON,
    "hung": Form.HUNG,
    "Hung second gain": Form.HUNG_SECOND_GAIN,
}


@pytest.mark.parametrize(("name", "form"), NAMES.items())
def test_a_form_has_its_usual_names(name, form):
    assert form_named(name) is form
    assert form_named(f" {name.upper()} ") is form


@pytest.mark.parametrize("name", ["UD", "ud", " Joseph ", "hung second gain", "HUNG-SECOND-GAIN", "innovation"])
def test_the_class_of_forms_takes_a_name(name):
    assert Form(name) is Form[name.strip().upper().replace(" ", "_").replace("-", "_")]


@pytest.mark.parametrize("value", ["U D F", 9, -1, None, 1.5])
def test_the_class_of_forms_lists_its_names(value):
    with pytest.raises(ValueError, match=f"got form {value!r}; needed one of 'hung', .*, 'cholesky', .* of gpbnb.Form"):
        Form(value)


@pytest.mark.parametrize("form", list(Form), ids=str)
def test_a_form_is_found_by_the_name_that_is_shown(form):
    assert form_named(str(form)) is form
