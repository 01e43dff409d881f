"""gpbnb.report.ledger.finding: what a finding may be, how verdicts follow, and the registry of checks."""

import dataclasses

import numpy as np
import pytest
import sympy

from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare, given, unverifiable
from gpbnb.report.ledger.registry import Checks
from gpbnb.report.ledger.statements import Statement

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


def test_verdicts_are_those_of_the_contract():
    assert {verdict.value for verdict in Verdict} == {verdict for verdict, _ in ALLOWED}


@pytest.mark.parametrize("agrees", [True, False, None])
@pytest.mark.parametrize("verdict", list(Verdict))
def test_verdict_must_fit_agreement(verdict, agrees):
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


@pytest.mark.parametrize("agrees", [np.True_, sympy.true, 1, 0, "yes"])
def test_agreement_must_be_a_real_bool(agrees):
    for make in (
        lambda: Finding("1", agrees, Verdict.VERIFIED),
        lambda: compare(agrees, "1"),
        lambda: answer(agrees, "1", "here"),
    ):
        with pytest.raises(TypeError, match=r"needed a bool.*; use bool\(\.\.\.\)"):
            make()


@pytest.mark.parametrize("make", [compare, lambda agrees, text: answer(agrees, text, "here")])
def test_no_outcome_is_not_a_comparison(make):
    with pytest.raises(TypeError, match="None of type NoneType; needed a bool"):
        make(None, "1")


@pytest.mark.parametrize(
    ("fields", "error", "message"),
    [
        ((1, True, Verdict.VERIFIED), TypeError, "recomputed=1 of type int; needed a str"),
        (("1", True, Verdict.VERIFIED, None), TypeError, "note=None of type NoneType; needed a str"),
        (("1", True, "verified"), TypeError, "verdict='verified' of type str; needed one of"),
        (("$1", True, Verdict.VERIFIED), ValueError, "recomputed='\\$1' with an unpaired or doubled dollar sign"),
        (("1", True, Verdict.VERIFIED, "$$a$$"), ValueError, "note='\\$\\$a\\$\\$' with an unpaired or doubled"),
        (("", True, Verdict.VERIFIED), ValueError, "agrees=True with a blank recomputed"),
        ((" ", False, Verdict.MISPRINT), ValueError, "agrees=False with a blank recomputed"),
        (
            ("1", None, Verdict.UNVERIFIABLE, " "),
            ValueError,
            "'unverifiable' without a note; needed a note that says which data",
        ),
        (("1", True, Verdict.ANSWERED), ValueError, "'answered' without a note; needed a note that says where"),
    ],
)
def test_bad_fields_are_refused(fields, error, message):
    with pytest.raises(error, match=message):
        Finding(*fields)


def test_finding_is_frozen():
    finding = compare(True, "1")
    with pytest.raises(dataclasses.FrozenInstanceError):
        finding.agrees = False


@pytest.mark.parametrize("otherwise", [Verdict.MISPRINT, Verdict.WRONG, Verdict.INCONSISTENT, Verdict.OCR])
def test_compare(otherwise):
    assert compare(True, "4", otherwise, "n") == Finding("4", True, Verdict.VERIFIED, "n")
    assert compare(False, "4", otherwise, "n") == Finding("4", False, otherwise, "n")
    assert compare(True, "4", otherwise, "n", "no").note == "n"
    assert compare(False, "4", otherwise, "n", "no").note == "no"
    assert compare(False, "4", otherwise, "n", "").note == ""


def test_compare_calls_a_disagreement_wrong_unless_told():
    assert compare(False, "4").verdict is Verdict.WRONG


@pytest.mark.parametrize(
    "otherwise", [Verdict.VERIFIED, Verdict.UNVERIFIABLE, Verdict.OPEN, Verdict.ANSWERED, "misprint"]
)
@pytest.mark.parametrize("agrees", [True, False])
def test_compare_refuses_other_verdicts_whatever_the_outcome(agrees, otherwise):
    with pytest.raises(ValueError, match="needed one of wrong, inconsistent, not reproduced, misprint, ocr"):
        compare(agrees, "4", otherwise)


def test_answer():
    assert answer(True, "4", "here") == Finding("4", True, Verdict.ANSWERED, "here")
    assert answer(False, "4", "here") == Finding("4", False, Verdict.OPEN, "here")


@pytest.mark.parametrize("holds", [True, False])
def test_answer_says_where(holds):
    with pytest.raises(ValueError, match="without a note"):
        answer(holds, "4", "")


def test_unverifiable():
    assert unverifiable("", "no data") == Finding("", None, Verdict.UNVERIFIABLE, "no data")
    with pytest.raises(ValueError, match="without a note"):
        unverifiable("4", "")


def made(key):
    return Statement(key, "hung1984", "II", "1", key, "equation", "a")


def good() -> Finding:
    return compare(True, "1")


def other() -> Finding:
    return compare(False, "2")


def test_checks_is_a_mapping_that_keeps_order_and_shares_functions():
    checks = Checks()
    assert checks.add("b", "a")(good) is good
    checks.add("c")(other)
    assert list(checks) == ["b", "a", "c"]
    assert len(checks) == 3
    assert "a" in checks
    assert "z" not in checks
    assert checks["a"] is checks["b"] is good
    assert dict(checks) == {"b": good, "a": good, "c": other}
    assert checks.run(made("a")) == good()
    assert checks.run(made("c")) == other()
    assert repr(checks) == "Checks(3 ids)"


def test_a_second_check_of_an_id_is_refused_and_nothing_of_it_registered():
    checks = Checks()
    checks.add("a")(good)
    with pytest.raises(ValueError, match=r"two checks of 'a', .*good and .*other"):
        checks.add("b", "a")(other)
    assert dict(checks) == {"a": good}


def test_an_id_given_twice_at_once_is_refused():
    with pytest.raises(ValueError, match=r"two checks of 'a', .*good and .*good"):
        Checks().add("a", "a")(good)


def test_missing_id():
    checks = Checks()
    checks.add("a")(good)
    for look in (lambda: checks.run(made("z")), lambda: checks["z"]):
        with pytest.raises(KeyError, match=r"'z', which has no check here; needed one of the 1 ids"):
            look()
    assert checks.get("z") is None


@pytest.mark.parametrize("result", [None, True, "verified", (True, "1")])
def test_a_check_must_return_a_finding(result):
    def lazy():
        return result

    checks = Checks()
    checks.add("a")(lazy)
    with pytest.raises(TypeError, match=r"got .* from the check of 'a', .*lazy; needed a Finding"):
        checks.run(made("a"))


def test_a_check_takes_the_printed_statement():
    checks = Checks()
    checks.add("a", "b")(lambda printed: compare(printed.id == "a", printed.id))
    assert [checks.run(made(key)).verdict for key in "ab"] == [Verdict.VERIFIED, Verdict.WRONG]


def test_a_check_takes_nothing_else():
    with pytest.raises(TypeError, match="with several arguments; needed a check that takes only the printed statement"):
        Checks().add("a")(lambda x, y: good())


def test_given_has_nothing_to_compare():
    assert given("a definition") == Finding("", None, Verdict.GIVEN, "a definition")
    with pytest.raises(ValueError, match="without a note"):
        given("")


def test_only_a_disagreement_has_a_root_error():
    assert compare(False, "4", root="product").root == "product"
    assert compare(True, "4", root="product").root == ""
    with pytest.raises(ValueError, match="with the root error 'product'"):
        Finding("4", True, Verdict.VERIFIED, root="product")


@pytest.mark.parametrize(
    ("ids", "error", "message"),
    [((), TypeError, "without an id"), ((good,), TypeError, "needed an id, as in"), ((" ",), ValueError, "blank")],
)
def test_ids_are_given(ids, error, message):
    with pytest.raises(error, match=message):
        Checks().add(*ids)
