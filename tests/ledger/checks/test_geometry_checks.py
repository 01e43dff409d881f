"""gpbnb.ledger.checks.geometry: the state of the ledger of ch. IV, and that each check can come out otherwise."""

from __future__ import annotations

from collections import Counter

import faults
import numpy as np
import pytest
import sympy as sp

from gpbnb.display.derivation import Derivation, Step
from gpbnb.geometry import derivation, experiment, theory
from gpbnb.ledger.checks import geometry as checks
from gpbnb.ledger.finding import Verdict
from gpbnb.measurement import ARCSEC, deroll

INVENTORY = faults.INVENTORY
ENTRIES = [entry for entry in INVENTORY if entry.id in checks.CHECKS]
FUNCTIONS = faults.functions(checks.CHECKS)


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


def test_every_entry_of_chapter_iv_has_a_check_here():
    fourth = {entry.id for entry in INVENTORY if entry.id.startswith("hung1982.IV.")}
    assert fourth <= set(checks.CHECKS)
    assert all(key.startswith("hung1982.I.") for key in set(checks.CHECKS) - fourth)
    assert {f"hung1982.IV.eq{n}" for n in range(1, 13)} <= fourth


def test_verdicts(rows):
    """The present state: to be changed knowingly."""
    assert Counter(row.outcome for row in rows) == {
        "verified": 20,
        "misprint": 1,
        "wrong": 3,
        "inconsistent": 7,
        "unverifiable": 2,
        "answered": 2,
    }
    assert faults.by_verdict(rows)[Verdict.WRONG] == {
        "hung1982.IV.eq8",
        "hung1982.IV.eq9",
        "hung1982.IV.identity-transformation",
    }


def test_findings_have_their_notes_and_numbers(rows):
    faults.check_texts(rows)
    found = {row.statement.id.removeprefix("hung1982."): row.finding for row in rows}
    assert "0, 45, 90 degrees" in found["IV.deltas-zero"].recomputed
    assert "31 arcseconds" in found["IV.identity-transformation"].note
    assert "signs to change: 2, before C, C" in found["IV.eq8"].recomputed
    assert r"\theta_3\cos2" in found["IV.eq9"].recomputed
    assert "gamma1 0.64" in found["IV.use-of-model"].recomputed


@pytest.fixture
def patch(monkeypatch):
    with faults.forgetting(monkeypatch, checks):
        yield monkeypatch.setattr


def wrong_steps(names):
    return lambda: Derivation(tuple(Step(name, sp.Integer(1), sp.Integer(2)) for name in names))


ROWS = [f"{eq}, {row} row" for eq in ("(5)", "(6)", "(7)") for row in ("first", "second")]


#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("two_precessions", derivation, "precessions", wrong_steps("a")),
    ("larger_effect", theory, "precession_rates", lambda altitude: (1.0, 2.0)),
    ("approximately_parallel", checks, "RIGEL", 0.5),
    ("theories_differ", checks, "geodetic_of_brans_dicke", lambda omega: sp.Integer(1)),
    ("progress_report", checks, "deroll_errors", lambda: (0.0, 0.0)),
    ("six_frames", checks, "frames_of_a_case", lambda: np.stack([np.eye(3)] * 6)),
    (
        "equation_1",
        derivation,
        "printed_small",
        lambda a: sp.Matrix(3, 3, [1, a[2], a[1], -a[2], 1, a[0], a[1], -a[0], 1]),
    ),
    ("equation_2", derivation, "printed_small", lambda a: sp.eye(3)),
    ("equation_3", derivation, "orders_agree", lambda: False),
    ("equation_4", derivation, "printed_small", lambda a: sp.eye(3)),
    ("equation_5", derivation, "deroll", wrong_steps(ROWS)),
    ("equation_6", derivation, "deroll", wrong_steps(ROWS)),
    ("equation_7", derivation, "deroll", wrong_steps(ROWS)),
    ("deroll_matrix", derivation, "turn", lambda axis, angle: sp.eye(3)),
    ("first_angles", derivation, "aligned", lambda v: sp.Matrix([1, derivation.ALPHA[0], 0])),
    ("known", checks, "compensated", lambda: ARCSEC),
    ("colinear", checks, "boresight_offset", lambda angles: 1.0),
    ("errors_of_estimates", checks, "error_of", lambda estimate, true: true - estimate),
    ("errors_of_estimates", checks, "drift_error", lambda theta, alpha: theta + alpha),
    ("use_of_model", theory, "effect", lambda case, rolling: theory.Effect((0, 0), (ARCSEC, 0), 0.0)),
]


@pytest.mark.parametrize(("name", "target", "attribute", "value"), DISAGREE)
def test_what_agrees_could_disagree(patch, name, target, attribute, value):
    assert FUNCTIONS[name]().agrees is True
    patch(target, attribute, value)
    faults.forget(checks)
    assert FUNCTIONS[name]().agrees is False


def good_estimates(y, z):
    C, S = derivation.C, derivation.S
    return -(C * y - S * z), S * y + C * z


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("deltas", checks, "gyro_to_readout", lambda phase: np.zeros(3)),
    ("readout_normal", checks, "spin_in_readout", lambda *angles: np.full(3, 3**-0.5)),
    ("boresight", checks, "boresight_offset", lambda beta: 0.0),
    ("absolute_frame", theory, "aberration", lambda altitude: (0.0, 0.0)),
    ("intermediate_frame", checks, "boresight_offset", lambda beta: 0.0),
    ("thetas", checks, "theta_of", lambda phi, alpha: phi),
    ("equation_8", derivation, "printed_estimates", good_estimates),
    ("equation_9", derivation, "printed_estimates", good_estimates),
    ("identity", experiment, "small_angle_errors", lambda *given: np.zeros(1)),
]


@pytest.mark.parametrize(("name", "target", "attribute", "value"), AGREE)
def test_what_disagrees_could_agree(patch, name, target, attribute, value):
    assert FUNCTIONS[name]().agrees is False
    patch(target, attribute, value)
    assert FUNCTIONS[name]().agrees is True


def test_both_parts_of_the_statement_on_phi_count(patch):
    assert FUNCTIONS["phi_frame"]().agrees is False
    true = checks.rotation
    patch(checks, "theta_of", lambda phi, alpha: phi)
    assert FUNCTIONS["phi_frame"]().agrees is False
    patch(checks, "rotation", lambda angles: true(angles).T)
    assert FUNCTIONS["phi_frame"]().agrees is True


def test_a_frame_that_moves_is_a_slip_only_while_the_drift_is_right(patch):
    assert FUNCTIONS["intermediate_frame"]().verdict is Verdict.MISPRINT
    patch(checks, "theta_of", lambda phi, alpha: phi)
    assert FUNCTIONS["intermediate_frame"]().verdict is Verdict.WRONG


def test_every_check_is_among_those_that_can_come_out_otherwise():
    tried = {name for name, *_ in (*DISAGREE, *AGREE)} | {"phi_frame"}  # above
    assert set(FUNCTIONS) - tried == {"pictures"}  # nothing to compare: they are lost


def test_errors_of_the_printed_deroll_are_up_to_twice_the_angle():
    printed, mended = checks.deroll_errors()
    assert printed == pytest.approx(2 * 17 * ARCSEC, rel=0.01)
    assert mended < 1e-12 * ARCSEC
    assert deroll([1.0, 0.0], 0.0).tolist() == [1, 0]
