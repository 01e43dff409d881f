"""gpbnb.rolling.checks: each entry of the chapter has a check, and each can come out otherwise."""

from __future__ import annotations

import math
from collections import Counter

import faults
import pytest

from gpbnb import ledger
from gpbnb.findings import Verdict
from gpbnb.rolling import checks, experiment, theory

ENTRIES = ledger.select(faults.INVENTORY, "hung1984", "III")


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


def test_every_entry_of_the_chapter_has_a_check_here():
    assert set(checks.CHECKS) == {entry.id for entry in ENTRIES}
    assert len(ENTRIES) == 55


def test_verdicts(rows):
    """The present state: to be changed knowingly."""
    assert Counter(row.outcome for row in rows) == {
        "verified": 42,
        "typo": 6,
        "wrong": 3,
        "unverifiable": 2,
        "answered": 2,
    }


def test_which_are_not_right_as_printed(rows):
    found = faults.by_verdict(rows)

    def ids(*places):
        return {f"hung1984.III.{place}" for place in places}

    assert found[Verdict.WRONG] == ids("s3.no-direct-error", "s4.sample-2-negligible", "s5.ramp-psd")
    assert found[Verdict.TYPO] == ids(
        "eq3",
        "s3.cos-5-deg",
        "s4.sample-1-s-to-0",
        "s4.sample-2-delta-omega",
        "s4.sample-2-period",
        "s5.ramp-transform",
    )
    assert found[Verdict.ANSWERED] == ids("s2.error-sources-4-and-5", "s5.optimum-bandwidth")
    assert found[Verdict.UNVERIFIABLE] == ids("s3.synchronisation-claim", "s6.references")


def test_no_finding_is_without_a_note_where_it_differs(rows):
    faults.check_texts(rows)


def verdict_of(place):
    return checks.CHECKS.run(f"hung1984.III.{place}").verdict


def test_printed_numbers_of_another_roll_period_would_be_found_out(monkeypatch):
    monkeypatch.setattr(checks, "PERIOD", 61.0)
    for place in ("s4.sample-1-omega-r", "s4.sample-1-delta-omega", "s4.sample-2-places"):
        assert verdict_of(place) is Verdict.WRONG


def test_printed_numbers_of_another_year_would_be_found_out(monkeypatch):
    monkeypatch.setattr(checks, "YEAR", 2 * theory.YEAR)
    for place in ("s4.sample-1-4-years", "s4.sample-1-pi-2", "s4.sample-2-40-000-years", "s4.sample-1-s-to-0"):
        assert verdict_of(place) is Verdict.WRONG


def test_smaller_drifts_would_make_the_claims_right(monkeypatch):
    monkeypatch.setattr(checks, "DRIFTS", (1.0, 1.0))
    assert verdict_of("s3.no-direct-error") is Verdict.VERIFIED
    assert verdict_of("s4.sample-2-negligible") is Verdict.VERIFIED


def test_a_printed_density_that_is_that_of_a_record_would_be_verified(monkeypatch):
    monkeypatch.setattr(theory, "printed_ramp_density", lambda k, f: theory.ramp_density(k, theory.YEAR, f))
    assert verdict_of("s5.ramp-psd") is Verdict.VERIFIED


def test_less_noise_would_make_extraction_easy(monkeypatch):
    monkeypatch.setattr(checks, "LEVEL", 1.0)
    assert verdict_of("s1.hard-to-extract") is Verdict.WRONG


@pytest.mark.parametrize("place", ["s2.error-sources-4-and-5", "s5.optimum-bandwidth"])
def test_an_answer_that_simulation_contradicts_stays_open(monkeypatch, place):
    expected = checks.expected_squares
    monkeypatch.setattr(checks, "expected_squares", lambda study: 1.5 * expected(study))
    assert verdict_of(place) is Verdict.OPEN


def test_wrong_matrices_would_be_found_out(monkeypatch):
    rotation = theory.rotation
    monkeypatch.setattr(theory, "rotation", lambda phase: rotation(-phase))
    assert verdict_of("eq7") is Verdict.WRONG


def test_noise_of_another_slope_would_be_found_out(monkeypatch):
    found, slope = checks.noise()
    steep = experiment.Slope(-1.2, slope.error, slope.decades)
    monkeypatch.setattr(checks, "noise", lambda: (found, steep))
    assert verdict_of("s1.phi-nn") is Verdict.WRONG


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_spectra_of_another_size_would_be_found_out(monkeypatch, factor):
    density = theory.flicker_density
    monkeypatch.setattr(theory, "flicker_density", lambda *a: factor * density(*a))
    assert verdict_of("s5.figure-iii-3-b") is Verdict.WRONG


def test_the_time_constant_of_a_lag():
    assert checks.lag_constant(theory.filter_lag(theory.single_pole(333.0))) == pytest.approx(333.0)
    assert math.isclose(checks.ALLOWED, 0.15)
