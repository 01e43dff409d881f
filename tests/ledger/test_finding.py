"""gpbnb.report.ledger.finding: what a finding may be, and how verdicts follow."""

import pytest

from gpbnb.report.ledger.finding import Finding, Verdict, compare

ALLOWED = {
    ("verified", True),
    ("misprint", False),
    ("wrong", False),
    ("inconsistent", False),
    ("not reproduced", False),
    ("ocr", False),
    ("unverifiable", None),
    ("given", None),
    ("open", False),
    ("open", None),
    ("answered", True),
}


def test_verdict_must_fit_agreement():
    for agrees in [True, False, None]:
        for verdict in list(Verdict):
            if (verdict.value, agrees) in ALLOWED:
                finding = Finding("$1$", agrees, verdict, "see (20)")
                assert (finding.recomputed, finding.agrees, finding.verdict, finding.note) == (
                    "$1$",
                    agrees,
                    verdict,
                    "see (20)",
                )
            else:
                with pytest.raises(ValueError, match=f"verdict '{verdict.value}' with agrees={agrees}; needed"):
                    Finding("$1$", agrees, verdict, "see (20)")


def test_only_a_disagreement_has_a_root_error():
    assert compare(False, "4", root="product").root == "product"
    assert compare(True, "4", root="product").root == ""
    with pytest.raises(ValueError, match="with the root error 'product'"):
        Finding("4", True, Verdict.VERIFIED, root="product")
