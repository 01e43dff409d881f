"""Further forms of the filter, for which there is neither a guarantee nor C code."""

from __future__ import annotations

from enum import StrEnum

from gpbnb.filters.forms import Form


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
