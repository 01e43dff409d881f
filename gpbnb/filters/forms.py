"""The forms of the filter: the order in which one step is computed."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

CONSTANT_GAIN = "constant gain"
"""Name of the form whose gain is the one that a filter approaches; such a filter is a linear system."""


def plain_name(name: str) -> str:
    """Return the name of a form in capitals, with underscores for blanks and hyphens."""
    return name.strip().upper().replace(" ", "_").replace("-", "_")


class Form(IntEnum):
    r"""The order in which a filter computes one step. In exact arithmetic, all forms agree.

    In the table, P_p is the predicted covariance, equation (100); all equation numbers are those of hung1984, ch. II.

    ================  ===================================================================================
    form              gain, covariance, estimate
    ================  ===================================================================================
    HUNG              the first form of (99); :math:`(I - KH)P_p`; (111) with (109) and (110)
    HUNG_SECOND_GAIN  the same, but the estimate uses :math:`P H^T R^{-1}`, the second form of (99), with
                      the new P
    INNOVATION        the first form of (99); :math:`(I - KH)P_p`; (98), with the innovation
    JOSEPH            as INNOVATION, but :math:`(I - KH)P_p(I - KH)^T + KRK^T`
    UD                Thornton's and Bierman's recursions for the factors of :math:`P = UDU^T`
    SYMMETRIZED       as INNOVATION; then each pair of entries of the covariance is replaced by its mean,
                      :math:`(P_{ij} + P_{ji})/2`
    COMPENSATED       as INNOVATION, with Kahan's compensated summation of the estimate
    POTTER            a square root :math:`P = SS^T`: modified Gram-Schmidt on :math:`(\Phi S, Q^{1/2})`, then
                      Potter's update by one measurement after the other
    CARLSON           the same with Carlson's update, which keeps S upper triangular, as a Cholesky factor
    ================  ===================================================================================

    Square roots decorrelate the measurements by the factors :math:`R = UDU^T`, as the UD form does.

    References
    ----------
    hung1984, ch. II, eqs. (98)-(101), (109)-(111); Kaminski, Bryson & Schmidt 1971; Carlson 1973; Bierman 1977, ch. II,
    V, VI.
    """

    HUNG = 0
    HUNG_SECOND_GAIN = 1
    INNOVATION = 2
    JOSEPH = 3
    UD = 4
    SYMMETRIZED = 5
    COMPENSATED = 6
    POTTER = 7
    CARLSON = 8

    def __str__(self) -> str:
        return _NAMES[self]

    @classmethod
    def _missing_(cls, value: Any) -> Form:
        """Find the member with a name in any case, such as ``Form("ud")``."""
        return form_named(value)


WITH_PROGRAM = tuple(Form)[:5]
"""Forms that have a guarantee, C code, and formats for their blocks."""

ROOTS = (Form.POTTER, Form.CARLSON)
"""Forms with a square root of the covariance."""

_NAMES = {
    Form.HUNG: "Hung (1984)",
    Form.HUNG_SECOND_GAIN: "Hung (1984), second gain",
    Form.INNOVATION: "innovation",
    Form.JOSEPH: "Joseph",
    Form.UD: "UD",
    Form.SYMMETRIZED: "symmetrized",
    Form.COMPENSATED: "compensated",
    Form.POTTER: "Potter",
    Form.CARLSON: "Carlson",
}

ALIASES = {"CHOLESKY": Form.CARLSON, "SQUARE_ROOT": Form.CARLSON, "SYMMETRISED": Form.SYMMETRIZED}
"""Other names of forms."""


def form_named(form: Form | str) -> Form:
    """Return a form, or the form with this name; case, blanks and hyphens are ignored.

    Examples
    --------
    >>> form_named("ud")
    <Form.UD: 4>
    >>> form_named("Cholesky")
    <Form.CARLSON: 8>
    """
    if isinstance(form, Form):
        return form
    if isinstance(form, str):
        wanted = plain_name(form)
        if wanted in ALIASES:
            return ALIASES[wanted]
        for each in Form:
            if wanted in (each.name, plain_name(str(each))):
                return each
    names = ", ".join(repr(each.lower()) for each in (*Form.__members__, *ALIASES))
    raise ValueError(f"got form {form!r}; needed one of {names} of gpbnb.Form")


def form_with_program(form: Form | str) -> Form:
    """Return a form that guarantees and C code know, or the one with this name."""
    found = form_named(form)
    if found not in WITH_PROGRAM:
        raise ValueError(f"got the {found} form; needed one of {', '.join(map(str, WITH_PROGRAM))}")
    return found
