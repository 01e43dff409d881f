"""gpbnb.filters.forms: forms of the filter by name."""

from __future__ import annotations

from gpbnb.filters.forms import Form, form_named

NAMES = {
    "innovation": Form.INNOVATION, "Joseph": Form.JOSEPH, "ud": Form.UD, "symmetrized": Form.SYMMETRIZED,
    "symmetrised": Form.SYMMETRIZED, "compensated": Form.COMPENSATED, "Potter": Form.POTTER, "Carlson": Form.CARLSON,
    "Cholesky": Form.CARLSON, "square root": Form.CARLSON, "square-root": Form.CARLSON, "hung": Form.HUNG,
    "Hung second gain": Form.HUNG_SECOND_GAIN,
}  # fmt: skip


def test_a_form_has_its_usual_names_and_the_one_that_is_shown():
    for name, form in (*NAMES.items(), *((str(form), form) for form in Form)):
        assert form_named(name) is form_named(f" {name.upper()} ") is Form(name) is form
