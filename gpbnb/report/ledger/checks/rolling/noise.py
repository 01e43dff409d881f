"""Checks of section 5: noise within the signal's band; and the references."""

from __future__ import annotations

import math

import numpy as np
import scipy
import sympy as sp

from gpbnb.report.ledger.checks.rolling.material import expected_squares, filter_study, spectra
from gpbnb.report.ledger.checks.rolling.registry import CHAPTER, CHECKS, entry
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import derivation, theory
from gpbnb.report.rolling.theory import DRIFTS, FLOWN_DENSITY, LEVEL, PERIOD, PERIOD_FLOWN


@CHECKS.add(entry("s5.ramp-transform"))
def ramp_transform(printed: Statement) -> Finding:
    k, w, s = sp.symbols("k omega s", positive=True)
    laplace = sp.laplace_transform(k * derivation.TIME, derivation.TIME, s, noconds=True)
    value = laplace.subs(s, sp.I * w)
    (link,) = printed.links({"k": k, "omega": w, "s": lambda omega: value})
    return compare(
        printed.equates and bool(sp.simplify(link.left - link.right) == 0),
        "$-k/\\omega^2+i\\pi k\\,\\delta'(\\omega)$",
        Verdict.MISPRINT if sp.simplify(sp.Abs(link.left) - link.right) == 0 else Verdict.WRONG,
        otherwise_note=(
            "the sign is wrong and the part at zero frequency is missing; the next line uses only the magnitude"
        ),
    )


@CHECKS.add(entry("s5.ramp-psd"))
def ramp_density(printed: Statement) -> Finding:
    cycles = np.array([10.0, 100.0])
    densities = []
    for cycle in cycles:
        omega = 2 * math.pi * cycle / YEAR
        names = {"k": 3.0, "omega": omega, "T": YEAR, "phi_SS": lambda omega: 0.0}
        densities.append(float(printed.relation().value(names, float)) * YEAR**-2)
    record = theory.ramp_density(3.0, YEAR, cycles / YEAR)
    slopes = [float(np.diff(np.log(d))[0] / np.log(10)) for d in (record, densities)]
    return compare(
        printed.equates and bool(np.all(abs(np.array(densities) / record - 1) < 0.01)),
        "for a record of a year, from 10 to 100 cycles a year, the density varies with frequency to "
        f"the power {slopes[0]:.2f}, not {slopes[1]:.2f}: $2k^2T/\\omega^2$",
        Verdict.MISPRINT,
        otherwise_note="$k^2/\\omega^4$ is the squared magnitude of a transform, not a power density, and describes "
        "an endless ramp; a record of finite length ends with a jump, so its spectrum falls much "
        "more slowly. Nothing later in the report uses this density",
    )


@CHECKS.add(entry("s5.spectrum-spread"))
def spread(printed: Statement) -> Finding:
    def excess(cycles: float) -> float:
        return float(theory.ramp_density(1.0, 1.0, cycles) / theory.ramp_density(1.0, 1.0, 1e-9)) - 0.5

    half = scipy.optimize.brentq(excess, 0.01, 2.0)
    # At a distance of m cycles, a constant signal has no density, and a ramp has 1/(pi m)^2 of its peak.
    beside = excess(1.0) + 0.5
    found = "nonzero" if math.isclose(beside, math.pi**-2) else "zero"
    return compare(
        printed.says("spread") == found,
        (
            f"the spectrum falls to half of its peak at {half:.3f} cycles per record, or "
            f"$\\delta\\omega={2 * math.pi * half:.2f}/T$"
        ),
        note="the length of the record thus determines the spread",
    )


@CHECKS.add(entry("s5.inphase-noise"))
def inphase_noise(printed: Statement) -> Finding:
    found = spectra()
    level = float(np.mean(found.base_noise) / theory.flicker_density(found.level, 1 / PERIOD))
    error = 1 / math.sqrt(8 * len(found.base_noise))
    shifted = "the inphase components" if abs(level - 1) < 4 * error else "no components"
    return compare(
        printed.says("noise") == shifted,
        f"the derolled noise at low frequency is ${level:.2f}\\pm{error:.2f}$ times $S(f_r)$",
        note="both the in-phase and the quadrature components are shifted, since there are two readouts",
    )


@CHECKS.add(entry("s5.not-completely"))
def not_completely(printed: Statement) -> Finding:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    error = math.sqrt(float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, best)))
    rate = theory.drift_error_rolled(LEVEL, PERIOD_FLOWN)
    study = filter_study()
    stays = bool(np.all(study.error > 4 * study.uncertainty) and error > 0 and rate > 0)
    return compare(
        printed.says("noise") == ("cannot be suppressed completely" if stays else "can be suppressed completely"),
        f"for noise of 200 mas/√Hz at the roll frequency, {error:.2f} mas remain after the best "
        f"low-pass filter, and {rate:.3f} mas a year after a fit over the year",
    )


@CHECKS.add(entry("s5.optimum-bandwidth-claim"))
def optimum_exists(printed: Statement) -> Finding:
    found = scipy.optimize.minimize_scalar(
        lambda log_b: float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, math.exp(log_b))),
        bounds=(math.log(1e-7), math.log(1e-2)),
        method="bounded",
    )
    best, closed = math.exp(found.x), theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    one = abs(best / closed - 1) < 1e-3 and derivation.filters().holds
    return compare(
        printed.says("choice") == ("an optimum choice" if one else "every choice"),
        f"$B=\\sqrt[3]{{k^2/(8N_0)}}={closed:.3g}$ Hz by the formula, {best:.3g} Hz by search",
        note=(
            "the claim holds if the ramp is read from the output of the filter; a fit over the record "
            "needs no choice of bandwidth"
        ),
    )


@CHECKS.add(entry("s5.optimum-bandwidth"))
def optimum() -> Finding:
    study = filter_study()
    worst = float(np.max(abs(study.error - expected_squares(study)) / study.uncertainty))
    poles = study.error[:3]
    least = math.sqrt(poles[1])
    snr = float(theory.signal_to_noise(DRIFTS[0], YEAR, poles[1]))
    return answer(
        bool(worst < 4 and np.argmin(poles) == 1),
        "the simulated rms errors at a third of the optimum bandwidth, at the optimum and at three "
        f"times the optimum are {', '.join(f'{math.sqrt(p):.2f}' for p in poles)} mas, within "
        f"{worst:.1f} standard errors of theory; over a year, the signal-to-noise ratio is "
        f"{10 * math.log10(snr):.0f} dB at an error of {least:.2f} mas",
        f"see the {CHAPTER}, section on noise within the band",
    )
