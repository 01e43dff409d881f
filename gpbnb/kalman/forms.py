"""The forms of the filter: the order in which one step is computed."""

from __future__ import annotations

from enum import IntEnum


class Form(IntEnum):
    r"""How one step is computed; all are the same in exact arithmetic. P_p is the predicted covariance (100).

    ========  ===========================================================================================
    form      gain, covariance, estimate
    ========  ===========================================================================================
    REPORT    the first form of (99); :math:`(I - KH)P_p`; (111) with (109) and (110)
    SECOND    the same, but the estimate takes :math:`P H^T R^{-1}`, the second form of (99), with the new P
    USUAL     the first form of (99); :math:`(I - KH)P_p`; (98), by the innovation
    JOSEPH    as USUAL, but :math:`(I - KH)P_p(I - KH)^T + KRK^T`
    UD        Thornton's and Bierman's recursions of the factors of :math:`P = UDU^T`
    ========  ===========================================================================================

    References
    ----------
    hung1984, ch. II, eqs. (98)-(101), (109)-(111); Bierman 1977, ch. V, VI.
    """

    REPORT = 0
    SECOND = 1
    USUAL = 2
    JOSEPH = 3
    UD = 4

    def __str__(self) -> str:
        return _NAMES[self]


_NAMES = {
    Form.REPORT: "report",
    Form.SECOND: "report, second gain",
    Form.USUAL: "innovation",
    Form.JOSEPH: "Joseph",
    Form.UD: "UD",
}
_REPORT, _SECOND, _USUAL, _JOSEPH, _UD = (int(each) for each in Form)

# Places in the notes that a compiled run leaves: steps done, the next mark, the first step at which a variance or pivot
