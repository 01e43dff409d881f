"""Read arguments as users write them: forms and roundings by name, and whole numbers."""

from __future__ import annotations

import operator
from typing import Any

from gpbnb.arithmetic.rounding import rounding_named
from gpbnb.filters.array_forms import ALIASES, AnyForm, ArrayForm
from gpbnb.filters.forms import Form

__all__ = ["checked_name", "compiled_form", "form_named", "rounding_named", "whole_number"]


def form_named(form: AnyForm | str) -> AnyForm:
    """Return a form, or the form with this name; case, blanks and hyphens are ignored.

    Raises
    ------
    ValueError : no such form.

    Examples
    --------
    >>> form_named("ud")
    <Form.UD: 4>
    >>> form_named("Cholesky")
    <ArrayForm.CARLSON: 'Carlson'>
    """
    if isinstance(form, (Form, ArrayForm)):
        return form
    if isinstance(form, str):
        wanted = _plain(form)
        if wanted in ALIASES:
            return ALIASES[wanted]
        for each in (*Form, *ArrayForm):
            if wanted in (each.name, _plain(str(each))):
                return each
    names = ", ".join(repr(each.name.lower()) for each in (*Form, *ArrayForm))
    raise ValueError(f"got form {form!r}; needed one of {names}, or a member of Form or ArrayForm")


def _plain(name: str) -> str:
    return name.strip().upper().replace(" ", "_").replace("-", "_")


def compiled_form(form: AnyForm | str) -> Form:
    """Return a form that has compiled loops, or the one with this name.

    Raises
    ------
    ValueError : no such form, or an :class:`~gpbnb.filters.array_forms.ArrayForm`.
    """
    found = form_named(form)
    if isinstance(found, ArrayForm):
        raise ValueError(f"got the {found} form; needed one with compiled loops: {', '.join(map(str, Form))}")
    return found


def whole_number(name: str, value: Any, least: int = 1) -> int:
    """Return a whole number that is not below `least`; True and False are not numbers.

    Raises
    ------
    ValueError : anything else.
    """
    if not isinstance(value, bool):
        try:
            number = operator.index(value)
        except TypeError:
            pass
        else:
            if number >= least:
                return number
    raise ValueError(f"got {value!r} {name}; needed a whole number, at least {least}")


def checked_name(name: Any) -> str:
    """Check that the name of a model is text, and return it.

    Raises
    ------
    TypeError : anything else.
    """
    if isinstance(name, str):
        return name
    raise TypeError(f"got name {name!r} of type {type(name).__name__}; needed text")
