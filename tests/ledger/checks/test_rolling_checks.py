"""ledger.checks.rolling: every statement of the chapter has a check, and the verdicts are the known ones."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace as changed
from types import SimpleNamespace

import faults
import numpy as np
import pytest
from faults import always, breaks, replace, times

from gpbnb.report import ledger
from gpbnb.report.ledger.checks import rolling as checks
from gpbnb.report.ledger.statements import statement
from gpbnb.report.rolling import derivation, experiment, theory

ENTRIES = ledger.select(faults.INVENTORY, "hung1984", "III")


def entry(place):
    return f"hung1984.III.{place}"


def test_the_short_record_has_the_signal_to_noise_ratio_of_a_year(monkeypatch):
    def drifted(drift, *_, samples):
        return 10.0 * samples * drift

    monkeypatch.setattr(experiment, "spectra", drifted)
    assert checks.spectra.__wrapped__() == pytest.approx(theory.DRIFTS[1] * experiment.YEAR)


def test_findings_quote_the_computed_results(rows):
    def quoted(place):
        return faults.finding(rows, entry(place)).recomputed

    sources = quoted("s2.five-error-sources")
    assert sources.startswith(f"phase of 1°: {6600 * math.sin(math.radians(1)):.3g}; ")
    assert f"frequency, ten digits: {6600 * 5e-12 * theory.YEAR:.3g}; " in sources
    assert sources.count(": ") == 5
    for place, error, digits in (("s4.sample-1-4-years", 5e-8, 2), ("s4.sample-2-40-000-years", 5e-12, 0)):
        assert quoted(place) == f"{2 * math.pi / error / theory.YEAR:.{digits}f} years"
    assert f"=0.{math.sin(math.pi / 180) ** 2 * 10**6:06.0f}$" in quoted("s3.one-degree")
    transform = quoted("s5.ramp-transform")
    assert transform == r"$-k/\omega^2+i\pi k\,\delta'(\omega)$"  # of kt


# -- each check depends on the computation ---------------------------------------------------------


def changes(module, name, function):
    """A cached simulation with another result, as one of the modules of checks sees it."""

    def apply(patch):
        found = function(getattr(module, name)())
        patch.setattr(module, name, always(found))

    return apply


def a_line(drift, duration, frequency):
    """The spectrum of a record of a constant signal."""
    return drift**2 * np.sinc(np.asarray(frequency) * duration) ** 2


DEROLL = derivation.deroll

OTHERS = itertools.count()

DEPENDS = [
    ("s1.phi-nn", changes(checks, "noise_spectrum", lambda found: (found[0], changed(found[1], value=-1.2)))),
    (
        "s1.phi-nn",
        changes(checks, "spectra", lambda f: changed(f, ramp=changed(f.ramp, density=f.ramp.density[::-1]))),
    ),
    ("s1.equivalent-modulation", changes(checks, "stages", lambda f: {**f, "rolled": np.conj(f["rolled"])})),
    ("s1.much-less", replace(theory, "flicker_density", always(1.0))),
    ("s1.recursively-computed", replace(derivation, "deroll", lambda angle: DEROLL(angle**2))),
    ("s1.recursively-computed", replace(theory, "recursion_bound", lambda n, beta: float(beta) / 10)),
    ("eq8", times(experiment, "fit_drift", 1.001)),
    ("s2.five-error-sources", replace(theory, "phase_error_cost", always(np.zeros(2)))),
    ("s2.five-error-sources", replace(theory, "rate_walk_error", always(0.0))),
    ("s2.five-error-sources", replace(theory, "drift_error_rolled", always(0.0))),
    ("s2.error-sources-4-and-5", times(checks, "expected_squares", 1.5)),
    ("s2.error-sources-4-and-5", times(theory, "rate_walk_error", 1.3)),
    ("s3.signal-to-noise", replace(theory, "rotation", always(np.eye(2)))),
    ("s3.less-than-04", replace(theory, "rotation", lambda angle: math.cos(2 * angle) * np.eye(2))),
    ("s4.sample-2-negligible", replace(theory, "off_tuned_loss", always(1e-3))),
    ("s1.carrier-on-each-gyro", changes(checks, "rolled_spins", lambda spins: abs(spins))),
    ("s1.pair-of-signals", replace(checks, "spin_in_readout", lambda theta, *angles: np.array([theta[1], 0, 0]))),
    ("s2.first-three", replace(checks, "load_statements", lambda: ())),
    ("s4.ideally-zero", replace(checks, "low_frequency", lambda signal, offset: next(OTHERS))),
    ("s4.various-degrees", replace(theory, "off_tuned_loss", always(0.5))),
    ("s4.finite-wordlength", replace(experiment, "rounded_rate_error", always(0.0))),
    ("s4.sample-1-omega-r", replace(checks, "PERIOD", 61.0)),
    ("s4.sample-1-delta-omega", replace(checks, "PERIOD", 61.0)),
    ("s4.sample-1-delta-omega", replace(checks, "SIX", checks.TEN)),
    ("s4.sample-1-4-years", replace(checks, "YEAR", 2 * theory.YEAR)),
    ("s4.sample-1-pi-2", replace(checks, "YEAR", 2 * theory.YEAR)),
    ("s4.sample-2-40-000-years", replace(checks, "YEAR", 2 * theory.YEAR)),
    ("s4.conclusion", times(theory, "off_tuned_drift", 1e9)),
    ("s5.spectrum-spread", replace(theory, "ramp_density", a_line)),
    ("s5.inphase-noise", times(theory, "flicker_density", 0.5)),
    ("s5.inphase-noise", times(theory, "flicker_density", 2.0)),
    ("s5.not-completely", replace(theory, "filtered_error", always(0.0))),
    ("s5.not-completely", replace(theory, "drift_error_rolled", always(0.0))),
    ("s5.optimum-bandwidth-claim", times(theory, "best_bandwidth", 1.01)),
    ("s5.optimum-bandwidth-claim", breaks(derivation, "filters")),
    ("s5.optimum-bandwidth", times(checks, "expected_squares", 1.5)),
    (
        "s5.optimum-bandwidth",
        changes(checks, "filter_study", lambda found: changed(found, squares=found.squares[[1, 0, *range(2, 6)]])),
    ),
]


@pytest.mark.parametrize(("key", "change"), DEPENDS)
def test_a_check_depends_on_the_computation(rows, monkeypatch, key, change):
    assert faults.finding(rows, entry(key)).agrees is True
    change(monkeypatch)
    checks.recursion.cache_clear()
    try:
        assert checks.CHECKS.run(statement(entry(key))).agrees is False
    finally:
        checks.recursion.cache_clear()


DISAGREES = [
    ("s3.no-direct-error", replace(checks, "DRIFTS", (1.0, 1.0))),
    ("s2.1-over-t", replace(theory, "flicker_density", lambda level, f: level * f)),
]


@pytest.mark.parametrize(("key", "change"), DISAGREES)
def test_a_check_that_disagrees_depends_on_the_computation(rows, monkeypatch, key, change):
    assert faults.finding(rows, entry(key)).agrees is False
    change(monkeypatch)
    assert checks.CHECKS.run(statement(entry(key))).agrees is True


@pytest.mark.parametrize(
    ("filters", "walks", "agrees"),
    [
        ([1.0, 1.3], [1.0, 1.0], True),
        ([1.0, 1.5], [1.0, 1.0], False),
        ([1.0, 1.0], [1.0, 1.3], False),
        ([1.0, 1.0], [1.3, 1.0], False),
    ],
)
def test_a_study_answers_only_if_every_simulation_agrees_with_its_theory(monkeypatch, filters, walks, agrees):
    """Within four standard errors, each a tenth of a filter's error and a twentieth of a walk's, from 200 pairs."""
    study = SimpleNamespace(error=np.array(filters), uncertainty=np.full(2, 0.1))
    expected = [theory.rate_walk_error(theory.DRIFTS[0], checks.WALK, reset=reset) for reset in (None, 60000.0)]
    monkeypatch.setattr(checks, "filter_study", always(study))
    monkeypatch.setattr(checks, "expected_squares", always(np.ones(2)))
    monkeypatch.setattr(checks, "walk_errors", always(np.outer(np.multiply(expected, walks), np.ones(400))))
    assert checks.CHECKS.run(statement(entry("s2.error-sources-4-and-5"))).agrees is agrees


def test_what_depends_on_the_noise_is_computed_from_it(monkeypatch):
    def texts():
        places = ("s1.hard-to-extract", "s1.before-noise")
        return [checks.CHECKS.run(statement(entry(place))).recomputed for place in places]

    before = texts()
    monkeypatch.setattr(checks, "LEVEL", 100 * theory.LEVEL)
    for text, start, size in zip((*before, *texts()), ("=", "error of ") * 2, (68, 68, 682, 682), strict=True):
        assert f"{start}{size}" in text


def test_the_time_constant_of_a_lag():
    assert checks.lag_constant(theory.filter_lag(theory.single_pole(333.0))) == pytest.approx(333.0)
    assert math.isclose(checks.ALLOWED, 0.15)
