"""The forms of the filter: the order in which one step is computed."""

from __future__ import annotations

from enum import IntEnum, StrEnum

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
    ================  ===================================================================================

    References
    ----------
    hung1984, ch. II, eqs. (98)-(101), (109)-(111); Bierman 1977, ch. V, VI.
    """

    HUNG = 0
    HUNG_SECOND_GAIN = 1
    INNOVATION = 2
    JOSEPH = 3
    UD = 4

    def __str__(self) -> str:
        return _NAMES[self]

    @classmethod
    def _missing_(cls, value: object) -> Form:
        """Find the member with a name in any case, such as ``Form("ud")``."""
        wanted = plain_name(str(value))
        for each in cls:
            if wanted in (each.name, plain_name(str(each))):
                return each
        names = ", ".join(repr(each.name.lower()) for each in cls)
        raise ValueError(f"got form {value!r}; needed one of {names}, or a number from 0 to {len(cls) - 1}")


_NAMES = {
    Form.HUNG: "Hung (1984)",
    Form.HUNG_SECOND_GAIN: "Hung (1984), second gain",
    Form.INNOVATION: "innovation",
    Form.JOSEPH: "Joseph",
    Form.UD: "UD",
}


class ArrayForm(StrEnum):
    r"""Further orders in which one step is computed; in exact arithmetic they agree with those of ``Form``.

    ============  =======================================================================================
    form          gain, covariance, estimate
    ============  =======================================================================================
    SYMMETRIZED   as ``Form.INNOVATION``; then each pair of entries of the covariance is replaced by its mean,
                  :math:`(P_{ij} + P_{ji})/2`
    COMPENSATED   as ``Form.INNOVATION``, with Kahan's compensated summation of the estimate
    POTTER        a square root :math:`P = SS^T`: modified Gram-Schmidt on :math:`(\Phi S, Q^{1/2})`, then
                  Potter's update by one measurement after the other
    CARLSON       the same with Carlson's update, which keeps S upper triangular, as a Cholesky factor
    ============  =======================================================================================

    Square roots decorrelate the measurements by the factors :math:`R = UDU^T`, as the UD form does.

    References
    ----------
    Kaminski, Bryson & Schmidt 1971; Carlson 1973; Bierman 1977, ch. II, V.
    """

    SYMMETRIZED = "symmetrized"
    COMPENSATED = "compensated"
    POTTER = "Potter"
    CARLSON = "Carlson"


AnyForm = Form | ArrayForm
"""Any form."""

ROOTS = (ArrayForm.POTTER, ArrayForm.CARLSON)
"""Forms with a square root of the covariance."""

ALIASES = {"CHOLESKY": ArrayForm.CARLSON, "SQUARE_ROOT": ArrayForm.CARLSON, "SYMMETRISED": ArrayForm.SYMMETRIZED}
"""Other names of forms."""
