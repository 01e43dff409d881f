"""gpbnb.report.ledger.checks.geometry: every statement of ch. IV has a check, and the verdicts are the known ones."""

from __future__ import annotations

from dataclasses import replace as changed

import faults
import numpy as np
import pytest
import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step
from gpbnb.report.geometry import derivation, theory
from gpbnb.report.ledger.checks import geometry
from gpbnb.report.ledger.statements import statement
from gpbnb.report.measurement import ARCSEC, deroll, rotation

INVENTORY = faults.INVENTORY
ENTRIES = [entry for entry in INVENTORY if entry.id in geometry.CHECKS]
CACHING = (geometry,)


def test_findings_have_their_notes_and_numbers(rows):
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


# -- each check depends on the computation ---------------------------------------------------------


def run(key):
    return geometry.CHECKS.run(statement(f"hung1982.{key}"))


def wrong_steps():
    return Derivation((Step("a", sp.Integer(1), sp.Integer(2)),))


TURN = derivation.turn

DEPENDS = [
    ("I.geodetic-motional-geometry", derivation, "precessions", wrong_steps),
    ("I.larger-effect", theory, "precession_rates", lambda altitude: (1.0, 2.0)),
    ("I.approximately-parallel", geometry, "RIGEL", 0.5),
    ("I.theories-differ", geometry, "geodetic_of_brans_dicke", lambda omega: sp.Integer(1)),
    ("I.progress-report", geometry, "deroll_errors", lambda: (0.0, 0.0)),
    ("IV.six-frames", geometry, "frames_of_a_case", lambda: np.stack([np.eye(3)] * 6)),
    ("IV.eq1", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.eq2", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.eq5", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.eq7", derivation, "turn", lambda axis, angle: TURN(axis, -angle)),
    ("IV.deroll-matrix", derivation, "turn", lambda axis, angle: sp.eye(3)),
    ("IV.theta1-alpha1", derivation, "aligned", lambda v: sp.Matrix([1, derivation.ALPHA[0], 0])),
    ("IV.known-misalignments", geometry, "compensated", lambda: ARCSEC),
    ("IV.axes-colinear", geometry, "boresight_offset", lambda angles: 1.0),
    ("IV.use-of-model", theory, "effect", lambda case, rolling: theory.Effect((0, 0), (ARCSEC, 0), 0.0)),
    ("IV.use-of-model", geometry, "THIRD_ORDER", 1e-3),
    ("IV.identity-transformation", derivation, "exact", lambda angles: TURN(1, sp.pi / 3)),
    ("IV.roll-axes-coincide", geometry, "roll", lambda phase: rotation([0.0, phase, 0.0])),
    ("IV.lined-up", geometry, "rotation", lambda angles: rotation(np.add(angles, 0.1))),
    ("IV.body-fixed", geometry, "roll", lambda phase: np.eye(3)),
    ("IV.projection-on-telescope", geometry, "star_in_telescope", lambda *angles: np.array([1.0, 0.0, 0.0])),
    ("IV.projection-on-readout", geometry, "spin_in_readout", lambda *angles: np.array([1.0, 0.0, 0.0])),
    ("IV.factors-of-1", geometry, "sets_of_angles", lambda number: ["alpha", "omega", "beta"]),
    ("IV.factors-of-2", geometry, "sets_of_angles", lambda number: ["beta", "gamma", "omega", "theta"]),
    ("IV.reduction", geometry, "ideal_chain", lambda k, misalignment: False),
    ("IV.label-of-5", geometry, "deroll", lambda readings, phase: 2 * readings),
    ("IV.label-of-6", geometry, "deroll", lambda readings, phase: 2 * readings),
    ("IV.estimated-by-deroll", geometry, "deroll", lambda readings, phase: deroll(readings, -phase)),
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
    ("IV.deltas-zero", geometry, "gyro_to_readout", lambda phase: np.zeros(3)),
    ("IV.all-small", geometry, "gyro_to_readout", lambda phase: np.zeros(3)),
    ("IV.readout-normal", geometry, "spin_in_readout", lambda *angles: np.array([0.0, 0.0, 1.0])),
    ("IV.absolute-frame", theory, "aberration", lambda altitude: (0.0, 0.0)),
    ("IV.intermediate-frame", geometry, "boresight_offset", lambda beta: 0.0),
    ("IV.thetas-drift", geometry, "theta_of", lambda phi, alpha: phi),
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
    patch.setattr(geometry, "RIGEL", np.radians(degrees))
    for word in ("approximately parallel to", "oblique to", "perpendicular to"):
        found = geometry.CHECKS.run(changed(printed, form=f"direction: {word} | along"))
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
    assert geometry.CHECKS.run(changed(printed, form=printed.form.replace(before, after))).agrees is False


def test_errors_of_the_printed_deroll_are_up_to_twice_the_angle():
    as_printed, corrected = geometry.deroll_errors()
    assert as_printed == pytest.approx(2 * 17, rel=0.01)
    assert corrected < 1e-12
    assert deroll([1.0, 0.0], 0.0).tolist() == [1, 0]
