"""gpbnb.report.ledger.checks.geometry: every statement of ch. IV has a check, and the verdicts are the known ones."""

from __future__ import annotations

from dataclasses import replace as changed

import faults
import numpy as np
import pytest
import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step
from gpbnb.report.geometry import derivation, theory
from gpbnb.report.ledger.checks import geometry as checks
from gpbnb.report.ledger.checks.geometry import angles, definitions, equations, frames, precessions
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.statements import statement
from gpbnb.report.measurement import ARCSEC, deroll, rotation

INVENTORY = faults.INVENTORY
ENTRIES = [entry for entry in INVENTORY if entry.id in checks.CHECKS]
CACHING = (angles, definitions, equations, frames, precessions)


def test_every_entry_of_chapter_iv_has_a_check_here():
    fourth = {entry.id for entry in INVENTORY if entry.id.startswith("hung1982.IV.")}
    assert fourth <= set(checks.CHECKS)
    assert all(key.startswith("hung1982.I.") for key in set(checks.CHECKS) - fourth)
    assert {f"hung1982.IV.eq{n}" for n in range(1, 13)} <= fourth


def test_every_equation_has_a_form():
    assert [entry.id for entry in ENTRIES if entry.kind == "equation" and not entry.form] == []


def test_findings_have_their_notes_and_numbers(rows):
    faults.check_texts(rows)
    found = {row.statement.id.removeprefix("hung1982."): row.finding for row in rows}
    assert "0, 45, 90 degrees" in found["IV.deltas-zero"].recomputed
    # 60√2
    assert r"85 arcseconds apart with $\gamma_2=\gamma_3=60''$" in found["IV.axes-colinear"].recomputed
    assert "31 arcseconds" in found["IV.identity-transformation"].note
    assert "0.000 arcseconds a year, instead of 6.62 and 0.041" in found["I.spin-spin"].recomputed
    assert "takes at least 2 changes of sign; these signs stand before C, C" in found["IV.eq8"].recomputed
    # (5, 3) + (-2, 4); √(9² + 5²); 5 + 4; the declination of Rigel
    assert "is (3, 7) arcseconds" in found["IV.thetas-drift"].recomputed
    assert "turns by 10.3 arcseconds" in found["IV.intermediate-frame"].recomputed
    assert "they are 60 arcseconds apart" in found["IV.alphas-boresight"].recomputed
    rigel = "8.2 degrees with the Earth's axis, which is the declination of the star"
    assert rigel in found["I.approximately-parallel"].recomputed
    assert r"\theta_3\cos2" in found["IV.eq9"].recomputed
    assert "gamma1 0.64" in found["IV.use-of-model"].recomputed


@pytest.mark.parametrize(("number", "angle", "frame"), [(8, "alpha", "t"), (9, "theta", "r")])
def test_the_corrected_estimates_are_verified(number, angle, frame):
    form = (
        f"[[-{angle}_hat_3], [{angle}_hat_2]] == "
        f"[[cos(omega*t), -sin(omega*t)], [sin(omega*t), cos(omega*t)]]*[[y_{frame}], [z_{frame}]]"
    )
    corrected = changed(statement(f"hung1982.IV.eq{number}"), form=form)
    assert checks.CHECKS.run(corrected).verdict is Verdict.VERIFIED


# -- each check depends on the computation ---------------------------------------------------------


def run(key):
    return checks.CHECKS.run(statement(f"hung1982.{key}"))


def wrong_steps():
    return Derivation((Step("a", sp.Integer(1), sp.Integer(2)),))


TURN = derivation.turn

DEPENDS = [
    ("I.geodetic-motional-geometry", derivation, "precessions", wrong_steps),
    ("I.larger-effect", theory, "precession_rates", lambda altitude: (1.0, 2.0)),
    ("I.approximately-parallel", precessions, "RIGEL", 0.5),
    ("I.theories-differ", precessions, "geodetic_of_brans_dicke", lambda omega: sp.Integer(1)),
    ("I.progress-report", precessions, "deroll_errors", lambda: (0.0, 0.0)),
    ("IV.six-frames", frames, "frames_of_a_case", lambda: np.stack([np.eye(3)] * 6)),
    ("IV.eq1", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.eq2", derivation, "turn", lambda axis, angle: TURN(axis, 2 * angle)),
    ("IV.eq5", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.eq7", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.deroll-matrix", derivation, "turn", lambda axis, angle: sp.eye(3)),
    ("IV.theta1-alpha1", derivation, "aligned", lambda v: sp.Matrix([1, derivation.ALPHA[0], 0])),
    ("IV.known-misalignments", angles, "compensated", lambda: ARCSEC),
    ("IV.axes-colinear", angles, "boresight_offset", lambda angles: 1.0),
    ("IV.use-of-model", theory, "effect", lambda case, rolling: theory.Effect((0, 0), (ARCSEC, 0), 0.0)),
    ("IV.use-of-model", angles, "THIRD_ORDER", 1e-3),
    ("IV.identity-transformation", derivation, "exact", lambda angles: TURN(1, sp.pi / 3)),
    ("IV.roll-axes-coincide", definitions, "roll", lambda phase: rotation([0.0, phase, 0.0])),
    ("IV.lined-up", definitions, "rotation", lambda angles: rotation(np.add(angles, 0.1))),
    ("IV.body-fixed", definitions, "roll", lambda phase: np.eye(3)),
    ("IV.projection-on-telescope", definitions, "star_in_telescope", lambda *angles: np.array([1.0, 0.0, 0.0])),
    ("IV.projection-on-readout", definitions, "spin_in_readout", lambda *angles: np.array([1.0, 0.0, 0.0])),
    ("IV.factors-of-1", definitions, "sets_of_angles", lambda printed: ["alpha", "omega", "beta"]),
    ("IV.factors-of-2", definitions, "sets_of_angles", lambda printed: ["beta", "gamma", "omega", "theta"]),
    ("IV.reduction", definitions, "statement", lambda key: statement(key.replace("eq4", "eq3"))),
    ("IV.label-of-5", definitions, "deroll", lambda readings, phase: 2 * readings),
    ("IV.label-of-6", definitions, "deroll", lambda readings, phase: 2 * readings),
    ("IV.estimated-by-deroll", definitions, "deroll", lambda readings, phase: deroll(readings, -phase)),
    ("I.precession-in-orbit", theory, "precession_rates", lambda altitude: (0.0, 0.0)),
    ("I.spin-spin", theory, "precession_rates", lambda altitude, spin=1.0: (1.0, 0.5)),
]


@pytest.mark.parametrize(("key", "target", "attribute", "value"), DEPENDS)
def test_what_agrees_could_disagree(rows, patch, key, target, attribute, value):
    assert faults.finding(rows, f"hung1982.{key}").agrees is True
    patch.setattr(target, attribute, value)
    assert run(key).agrees is False


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("IV.deltas-zero", frames, "gyro_to_readout", lambda phase: np.zeros(3)),
    ("IV.all-small", frames, "gyro_to_readout", lambda phase: np.zeros(3)),
    ("IV.readout-normal", frames, "spin_in_readout", lambda *angles: np.array([0.0, 0.0, 1.0])),
    ("IV.absolute-frame", theory, "aberration", lambda altitude: (0.0, 0.0)),
    ("IV.intermediate-frame", frames, "boresight_offset", lambda beta: 0.0),
    ("IV.thetas-drift", frames, "theta_of", lambda phi, alpha: phi),
]


@pytest.mark.parametrize(("key", "target", "attribute", "value"), AGREE)
def test_what_disagrees_could_agree(rows, patch, key, target, attribute, value):
    assert faults.finding(rows, f"hung1982.{key}").agrees is False
    patch.setattr(target, attribute, value)
    assert run(key).agrees is True


@pytest.mark.parametrize(
    ("degrees", "right"),
    [(8, "approximately parallel to"), (-12, "oblique to"), (78, "oblique to"), (-82, "perpendicular to")],
)
def test_the_direction_of_the_geodetic_drift_is_that_of_the_star(patch, degrees, right):
    printed = statement("hung1982.I.approximately-parallel")
    patch.setattr(precessions, "RIGEL", np.radians(degrees))
    for word in ("approximately parallel to", "oblique to", "perpendicular to"):
        found = checks.CHECKS.run(changed(printed, form=f"direction: {word} | along"))
        assert found.agrees == (word == right)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("[[x_", "[[2*x_"),
        ("[[1], [0], [0]]", "[[0], [1], [0]]"),
        ("[[1], [0], [0]]", "2*[[1], [0], [0]]"),
        ("[[1, 0, 0], [0, cos(omega*t), sin(omega*t)], [0, -sin(omega*t), cos(omega*t)]]*", ""),
    ],
    ids=["another reading", "another axis", "twice the axis", "no roll"],
)
def test_a_chain_leads_from_the_first_axis_to_the_reading(number, before, after):
    printed = statement(f"hung1982.IV.eq{number}")
    assert printed.form.count(before) == 1
    assert checks.CHECKS.run(changed(printed, form=printed.form.replace(before, after))).agrees is False


def test_the_printed_deroll_is_a_slip_only_while_the_other_equations_are_right(patch):
    assert run("IV.eq8").verdict is Verdict.MISPRINT
    patch.setattr(equations, "later_uses_are_right", lambda: False)
    assert run("IV.eq8").verdict is Verdict.WRONG


@pytest.mark.parametrize("number", [5, 12])
def test_the_equations_that_use_the_estimates_are_looked_at(patch, number):
    assert equations.later_uses_are_right()
    statements = {f"hung1982.IV.eq{k}": statement(f"hung1982.IV.eq{k}") for k in (5, 6, 7, 12)}
    printed = statements[f"hung1982.IV.eq{number}"]
    altered = printed.form.replace("- Deltaalpha_2", "+ Deltaalpha_2").replace("[-alpha_3]", "[alpha_3]")
    assert altered != printed.form
    statements[printed.id] = changed(printed, form=altered)
    equations.later_uses_are_right.cache_clear()
    patch.setattr(equations, "statement", statements.__getitem__)
    assert not equations.later_uses_are_right()


def test_a_frame_that_moves_is_a_slip_only_while_the_drift_is_right(patch):
    assert run("IV.intermediate-frame").verdict is Verdict.MISPRINT
    patch.setattr(frames, "theta_of", lambda phi, alpha: phi)
    assert run("IV.intermediate-frame").verdict is Verdict.WRONG


def test_a_first_order_that_depends_on_the_order_of_the_turns_is_refused(patch):
    exact = derivation.exact
    last = derivation.SEQUENCES[-1]
    patch.setattr(derivation, "exact", lambda angles, order: exact(angles, order) ** (2 if order == last else 1))
    with pytest.raises(ArithmeticError, match="needed the same first order for all"):
        equations.rotation_to_first_order("alpha")


def test_errors_of_the_printed_deroll_are_up_to_twice_the_angle():
    as_printed, corrected = precessions.deroll_errors()
    assert as_printed == pytest.approx(2 * 17 * ARCSEC, rel=0.01)
    assert corrected < 1e-12 * ARCSEC
    assert deroll([1.0, 0.0], 0.0).tolist() == [1, 0]
