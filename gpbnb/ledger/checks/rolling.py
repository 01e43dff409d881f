"""A check for each ledger entry of hung1984, ch. III."""

from __future__ import annotations

import math
from functools import cache, partial
from itertools import pairwise

import numpy as np
import sympy as sp
from scipy import optimize

from gpbnb.arithmetic.formats import FloatFormat, Rounding, prints_as
from gpbnb.display.tables import scientific
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Checks
from gpbnb.measurement import YEAR
from gpbnb.rolling import derivation, experiment, theory
from gpbnb.rolling.theory import DRIFTS, FLOWN_DENSITY, LEVEL, PERIOD, PERIOD_FLOWN

CHECKS = Checks()

CHAPTER = "chapter *Roll and deroll*"
SIX, TEN = FloatFormat(10, 6), FloatFormat(10, 10)
ALLOWED = 0.15
"""Share of a single error in mas that hung1982, ch. II, gives in the text on its Figure II-2."""


def entry(place: str) -> str:
    return f"hung1984.III.{place}"


# -- material -------------------------------------------------------------------------------------


@cache
def spectra() -> experiment.Spectra:
    """A short record, 600 turns, of a drift that is as strong beside its noise as that of a year."""
    samples = 36000
    return experiment.spectra(DRIFTS[1] * YEAR / (10.0 * samples), np.random.default_rng(3), 4, samples=samples)


@cache
def noise() -> tuple[experiment.Spectrum, experiment.Slope]:
    found = experiment.noise_spectrum(np.random.default_rng(1), 2**17, 8, 2**15, bands=16)
    return found, experiment.fit_slope(found)


@cache
def stages() -> dict[str, np.ndarray]:
    """A drift through (5)-(7) with noise, 20 turns of 600 s."""
    return experiment.derolled_record((2e6, 1e6), 400.0, PERIOD, np.random.default_rng(2), 1200)


@cache
def filter_study() -> experiment.FilterStudy:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    rng = np.random.default_rng(8)
    return experiment.filter_study(DRIFTS[0], [best / 3, best, 3 * best], 8, rng, duration=YEAR / 16)


@cache
def walk_errors() -> np.ndarray:
    """Drift errors, never reset and reset every 100 steps of 600 s, of 200 random walks of the roll rate."""
    walks = experiment.rate_walks(WALK, 200, 52560, 600.0, np.random.default_rng(9))
    return experiment.roll_rate_errors(DRIFTS[0], walks, 600.0, [None, 100])


WALK = 3e-6 / YEAR**3
"""Intensity of a roll rate, rad²/s³, at which the phase has wandered by a milliradian after a year."""


def deviation(found: float, expected: float, error: float) -> float:
    """Difference in standard errors."""
    return (found - expected) / error


# -- section 1: rolling and derolling --------------------------------------------------------------


@CHECKS.add(entry("s1.phi-nn"))
def density_of_noise() -> Finding:
    found, slope = noise()
    year = spectra()
    heaviest = int(np.argmax(found.density)) == 0 == int(np.argmax(year.ramp.density))
    return compare(
        bool(abs(slope.value + 1) < 3 * slope.error and heaviest),
        f"the generated noise has a slope of ${slope.value:.3f}\\pm{slope.error:.3f}$ over {slope.decades:.1f} "
        "decades; it and the signal are both heaviest at the lowest frequency",
        note="the $1/f$ law itself is assumed; no document gives its strength",
    )


@CHECKS.add(entry("s1.hard-to-extract"))
def hard_to_extract() -> Finding:
    error = theory.drift_error_unrolled(LEVEL)
    return unverifiable(
        f"without rolling the standard error of a year's drift is $3\\sqrt{{A}}/T={error:.0f}$ mas a year, "
        f"for {math.sqrt(LEVEL * PERIOD_FLOWN):.0f} mas/√Hz at {PERIOD_FLOWN} s; frame dragging is {DRIFTS[1]:.0f}, "
        f"the geodetic drift {DRIFTS[0]:.0f}",
        "the strength of the noise is not in the documents; the error scales with its amplitude",
    )


@CHECKS.add(entry("s1.before-noise"))
def before_noise() -> Finding:
    early, late = theory.drift_error_unrolled(LEVEL), theory.drift_error_rolled(LEVEL, PERIOD)
    return unverifiable(
        f"all that rolling gains rests on it: noise that is there before the roll is turned back with the signal, and "
        f"would leave a standard error of {early:.0f} mas a year in our example, noise that comes after it {late:.2f}",
        "where in the readout the noise arises is not in the documents",
    )


@CHECKS.add(entry("s1.much-less"))
def much_less() -> Finding:
    found = spectra()
    simulated = float(found.noise.density[0] / np.mean(found.line_noise))
    year = float(theory.flicker_density(LEVEL, 1 / YEAR) / theory.flicker_density(LEVEL, 1 / PERIOD))
    return compare(
        min(simulated, year) > 100,
        f"the density at a cycle a year is {year:.0f} times that at a roll period of {PERIOD:g} s; "
        f"{simulated:.0f} times in a simulated record of {found.duration / PERIOD:.0f} turns, from its lowest band",
        note="as the number of turns, for noise that follows the $1/f$ law down to a cycle a year",
    )


@CHECKS.add(entry("s1.figure-iii-1-a"))
def figure_1a() -> Finding:
    found = spectra()
    lowest = found.ramp.density[0] / found.noise.density[0]
    return compare(
        bool(lowest < 1 and np.argmax(found.noise.density) == 0 and np.argmax(found.ramp.density) == 0),
        f"signal over noise in the lowest band: {lowest:.1g}",
        note=f"drawn from simulated data in the {CHAPTER}",
    )


@CHECKS.add(entry("s1.figure-iii-1-b"))
def figure_1b() -> Finding:
    found = spectra()
    peak = abs(found.offset[np.argmax(found.line_signal)])
    beside = float(np.max(found.line_signal) / np.mean(found.line_noise))
    return compare(
        bool(peak == 1 and beside > 1),
        f"the rolled signal is heaviest next to $f_r$, {beside:.0f} times the noise there",
        note=f"drawn from simulated data in the {CHAPTER}",
    )


@CHECKS.add(entry("s1.equivalent-modulation"))
def equivalent() -> Finding:
    found = stages()
    turn = np.exp(1j * theory.roll_phase(np.arange(1200), PERIOD))
    back = found["rolled"] * turn
    error = float(np.max(abs(back - found["signal"])) / np.max(abs(found["signal"])))
    return compare(
        bool(error < 1e-12 and derivation.two_dimensions().holds_at(0, 1)),
        "as $z\\to ze^{-i\\omega_rt}$ and back; the two undo each other to twelve digits",
    )


@CHECKS.add(entry("s1.carriers"))
def carriers() -> Finding:
    t, theta, w = derivation.TIME, derivation.THETA, derivation.ROLL
    product = sp.cos(w * t) * sp.cos(w * t + theta)
    parts = sp.cos(theta) / 2 + sp.cos(2 * w * t + theta) / 2
    return compare(
        bool(sp.simplify(product - parts) == 0),
        "$c(t)\\,d(t)=\\frac12\\cos\\theta+\\frac12\\cos(2\\omega_rt+\\theta)$, which gives (3)",
        note="definitions",
    )


@CHECKS.add(entry("eq1"), entry("eq2"), entry("eq9"))
def one_dimension() -> Finding:
    record = experiment.derolled_record((1e6, 0.0), 400.0, PERIOD, np.random.default_rng(5), 600)
    carrier = np.cos(2 * np.pi * np.arange(600) * 10.0 / PERIOD)
    n = record["noise"].real
    error = np.max(abs(record["measured"].real - (record["signal"].real * carrier + n)))
    return compare(
        bool(error < 1e-9 * np.max(abs(record["measured"]))),
        "the first readout of (5) and (6) for $s_y=0$, to nine digits",
        note="a definition: one readout of the two-dimensional model",
    )


@CHECKS.add(entry("eq3"))
def eq3() -> Finding:
    t, theta, w, s, n = derivation.TIME, derivation.THETA, derivation.ROLL, derivation.SIGNAL, derivation.NOISE
    first = (s * sp.cos(w * t) + n) * sp.cos(w * t + theta)
    middle = s * sp.cos(w * t + theta) + n * sp.cos(w * t + theta)
    last = derivation.one_dimension().steps[0]
    return compare(
        bool(sp.simplify(first - middle) == 0),
        "first and last line are equal; the middle one lacks the factor $\\cos\\omega_rt$ of the signal",
        Verdict.MISPRINT if last.holds else Verdict.WRONG,
        otherwise_note="the last line, which is used, is right",
    )


@CHECKS.add(entry("eq4"))
def eq4() -> Finding:
    return compare(
        derivation.one_dimension().holds_at(1),
        "the mean of the signal's part over a turn",
        note="of the signal; the noise near $\\omega_r$ comes through the same filter, as section 5 says",
    )


@CHECKS.add(entry("s1.theta-0-optimum"))
def best_phase() -> Finding:
    theta = np.radians(np.arange(-90, 91))
    strength = sp.lambdify(derivation.THETA, derivation.one_dimension().steps[1].right / derivation.SIGNAL)
    return compare(
        bool(theta[np.argmax(strength(theta))] == 0),
        "$\\cos\\theta$ is largest at $\\theta=0$",
        note="in two dimensions the strength does not depend on θ, but the direction does",
    )


@CHECKS.add(entry("eq5"), entry("eq6"), entry("eq7"))
def eq7() -> Finding:
    found = stages()
    phase = theory.roll_phase(np.arange(1200), PERIOD)
    matrices = np.array([theory.rotation(p) for p in phase])
    pair = np.einsum("nij,nj->ni", matrices, np.array([found["signal"].real, found["signal"].imag]).T)
    noisy = pair + np.array([found["noise"].real, found["noise"].imag]).T
    back = np.einsum("nji,nj->ni", matrices, noisy)
    error = np.max(abs(back - np.array([found["derolled"].real, found["derolled"].imag]).T))
    return compare(
        bool(error < 1e-9 * np.max(abs(found["derolled"])) and derivation.two_dimensions().holds_at(0, 1)),
        "matrix by matrix over 20 turns, and as a product with $e^{i\\omega_rt}$: alike to nine digits",
        note="the signal has no term at $2\\omega_r$ here, but where readouts have unequal gains",
    )


@CHECKS.add(entry("s1.recursively-computed"))
def recursively() -> Finding:
    n, step = sp.symbols("n delta", real=True)
    one_more = derivation.deroll(step) * derivation.deroll(n * step) - derivation.deroll((n + 1) * step)
    found = experiment.recursion(TEN, PERIOD, (60, 3600))
    return compare(
        bool(sp.simplify(one_more) == sp.zeros(2, 2) and np.all(found.size <= found.bound)),
        f"each matrix is that of the sample before times the one of a sample; in ten digits the product is off by "
        f"{scientific(found.size[0], 2)} after a turn of {PERIOD:g} s and {scientific(found.size[1], 2)} after 60",
        note=f"(7) itself shows no recursion, and is as well computed without; its costs are in the {CHAPTER}",
    )


@CHECKS.add(entry("eq8"))
def eq8() -> Finding:
    record = experiment.derolled_record((2e6, 1e6), 0.0, PERIOD, np.random.default_rng(0), 1200)
    rates = experiment.fit_drift(record["derolled"])
    band = float(np.mean(spectra().base_noise))
    return compare(
        bool(np.allclose(rates, (2e6, 1e6), rtol=1e-9)),
        "drifts of $2\\times10^6$ and $10^6$ mas a year come back as "
        f"{scientific(rates[0], 7)} and {scientific(rates[1], 7)}",
        note=f"of the signal; of the noise a density of {scientific(band, 2)} mas²/Hz stays in the band, $S(f_r)$",
    )


@CHECKS.add(entry("s1.figure-iii-2"))
def figure_2() -> Finding:
    found = stages()
    rates = experiment.fit_drift(found["derolled"])
    error = theory.drift_error(400.0, 1200, PERIOD)
    worst = max(abs(deviation(rates[i], (2e6, 1e6)[i], error)) for i in range(2))
    return compare(
        bool(worst < 4),
        f"both drifts come back from the noise, {worst:.1f} standard errors off at most",
        note=f"drawn from simulated data in the {CHAPTER}",
    )


# -- section 2: the five sources --------------------------------------------------------------------


@CHECKS.add(entry("s2.five-error-sources"))
def five_sources() -> Finding:
    filters = filter_study()
    found = {
        "phase of 1°": theory.phase_error_cost(DRIFTS, math.radians(1))[1],
        "frequency, ten digits": theory.off_tuned_drift(DRIFTS[0], 5e-12),
        "noise at the roll frequency": theory.drift_error_rolled(LEVEL, PERIOD),
        "filter at its best (mas)": math.sqrt(filters.error.min()),
        "roll rate": theory.rate_walk_error(DRIFTS[0], WALK),
    }
    return compare(
        bool(min(map(abs, found.values())) > 0),
        "; ".join(f"{name}: {value:.3g}" for name, value in found.items()) + " (mas a year)",
        note="the $1/T$ of the third is $1/f$; unequal gains of the readouts are a sixth source",
    )


@CHECKS.add(entry("s2.1-over-t"))
def one_over_t() -> Finding:
    long, short = (float(theory.flicker_density(LEVEL, 1 / period)) for period in (PERIOD, PERIOD / 2))
    _, slope = noise()
    return compare(
        math.isclose(long / short, 1 / 2),
        f"half the roll period divides the density of $1/f$ noise at the roll frequency by {long / short:g}; noise as "
        "$1/T$ would be doubled",
        Verdict.MISPRINT if abs(slope.value + 1) < 3 * slope.error else Verdict.WRONG,
        otherwise_note="T for f, by the author or the scan; $1/f$ in all other places",
    )


@CHECKS.add(entry("s2.error-sources-4-and-5"))
def sources_4_and_5() -> Finding:
    study = filter_study()
    expected = expected_squares(study)
    filters = float(np.max(abs(study.error - expected) / study.uncertainty))
    sizes = np.sqrt(np.mean(walk_errors() ** 2, axis=1))
    theory_sizes = [theory.rate_walk_error(DRIFTS[0], WALK, reset=reset) for reset in (None, 60000.0)]
    walks = max(abs(deviation(s, e, e / math.sqrt(400))) for s, e in zip(sizes, theory_sizes, strict=True))
    return answer(
        bool(filters < 4 and walks < 4),
        f"simulation and theory differ by at most {filters:.1f} standard errors for filters, {walks:.1f} for a "
        f"wandering roll rate; there resets of the phase every 60000 s lower the error "
        f"{theory_sizes[0] / theory_sizes[1]:.0f} times",
        f"{CHAPTER}, sections on filters and on an uneven roll rate",
    )


def expected_squares(study: experiment.FilterStudy, duration: float = YEAR / 16) -> np.ndarray:
    """Lag and exact noise of the filters of a study; noise at the time where its logarithm has its mean."""
    middle = round(duration / theory.INTERVAL / math.e)
    expected = []
    for name, lag, width in zip(study.names, study.lag, study.bandwidth, strict=True):
        if name == "single pole":
            weights = theory.single_pole(lag_constant(lag))
        else:
            weights = theory.moving_average(1 / (2 * width))
        noise = theory.filtered_variance(weights, LEVEL, middle, study.period)
        expected.append((study.drift / YEAR * lag) ** 2 + noise)
    return np.array(expected)


def lag_constant(lag: float, interval: float = theory.INTERVAL) -> float:
    """Time constant of the single pole of a given lag."""
    return interval / math.log1p(interval / lag)


# -- section 3: phase ---------------------------------------------------------------------------------


@CHECKS.add(entry("s3.no-direct-error"))
def no_direct_error() -> Finding:
    cost = experiment.clean_drift_error(DRIFTS, lambda t: np.full(t.shape, math.radians(1)))
    limit = math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600
    return compare(
        bool(np.max(abs(cost)) < ALLOWED),
        f"in two dimensions one degree turns the geodetic drift into {cost[1]:.1f} mas a year of frame dragging and "
        f"changes the geodetic by {cost[0]:.2f}; a milliarcsecond a year allows {limit:.0f} arcseconds of roll",
        otherwise_note="true of the strength in one dimension; in two a phase error mixes the drifts",
    )


@CHECKS.add(entry("s3.signal-to-noise"))
def signal_to_noise() -> Finding:
    """Of a fitted drift, in one dimension: signal by (4), noise exactly, over 100 turns."""
    slope = theory.slope_weights(6000)
    phase = theory.roll_phase(np.arange(6000), PERIOD)
    angles = np.radians([0, 1, 60])
    noise = [theory.variance_of_sum(slope * np.cos(phase + angle), LEVEL) for angle in angles]
    kept = [float(np.cos(a) ** 2 * noise[0] / variance) for a, variance in zip(angles, noise, strict=True)]
    pair = theory.rotation(math.radians(60)) @ np.array(DRIFTS)
    return compare(
        abs(kept[1] - math.cos(angles[1]) ** 2) < 1e-3 and abs(kept[2] / math.cos(angles[2]) ** 2 - 1) < 0.05,
        f"in one dimension {kept[1]:.4f} of it is left at one degree, {kept[2]:.3f} at sixty: $\\cos^2\\theta$, as "
        "the noise does not change",
        note="in one dimension. In two nothing is lost: at sixty degrees the strength of both drifts together is "
        f"{math.hypot(*pair) / math.hypot(*DRIFTS):.3f} of what it was; only their direction is wrong",
    )


@CHECKS.add(entry("s3.one-degree"))
def one_degree() -> Finding:
    lost = 1 - math.cos(math.radians(1)) ** 2
    return compare(lost < 0.0004, f"$1-\\cos^21°={lost:.6f}$ at one degree")


@CHECKS.add(entry("s3.cos-5-deg"))
def cos_5() -> Finding:
    five, one = (1 - math.cos(math.radians(a)) ** 2 for a in (5, 1))
    return compare(
        prints_as(five, ".0004", *Rounding.documented()),
        f"$1-\\cos^25°={five:.4f}$; $1-\\cos^21°={one:.4f}$",
        Verdict.MISPRINT if one < 0.0004 < five else Verdict.WRONG,
        otherwise_note="5° for 1°, by the author or the scan: .9998 is the cosine of one degree",
    )


@CHECKS.add(entry("s3.9998"))
def printed_cosine() -> Finding:
    value = 1 - 0.9998**2
    cosine = math.cos(math.radians(1))
    return compare(
        prints_as(value, ".0004", *Rounding.documented()) and prints_as(cosine, ".9998", *Rounding.documented()),
        f"$1-.9998^2={value:.8f}$; $\\cos1°={cosine:.6f}$",
        note=f"from the full cosine, {1 - cosine**2:.4f}",
    )


@CHECKS.add(entry("s3.less-than-04"))
def less_than() -> Finding:
    lost = 100 * math.sin(math.radians(1)) ** 2
    return compare(lost < 0.04, f"{lost:.4f} % of the power", note="in one dimension")


@CHECKS.add(entry("s3.synchronisation-claim"))
def synchronisation() -> Finding:
    limit = math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600
    return unverifiable(
        f"one degree is not enough: a milliarcsecond a year needs {limit:.0f} arcseconds",
        "nothing is said of the star sensor's accuracy",
    )


# -- section 4: frequency -------------------------------------------------------------------------------


@CHECKS.add(entry("eq10"))
def eq10() -> Finding:
    return compare(derivation.one_dimension().holds_at(2), "derived")


@CHECKS.add(entry("eq11"))
def eq11() -> Finding:
    return compare(
        derivation.one_dimension().holds_at(2),
        "the first term of (10)",
        note="of the signal; in two dimensions the drift across gets $s\\sin\\Delta\\omega t$",
    )


@CHECKS.add(entry("s4.various-degrees"))
def various_degrees() -> Finding:
    errors = {t: float(theory.worst_rate_error(PERIOD, FloatFormat(10, t))) for t in range(6, 11)}
    lost = [theory.off_tuned_loss(error) for error in errors.values()]
    ramp = 1 - float(theory.fitted_drift((1.0, 0.0), partial(np.multiply, errors[6]))[0])
    return compare(
        all(a > b for a, b in pairwise(lost)),
        f"a constant loses {', '.join(f'{part:.1g}' for part in lost)} of itself in a year, with six to ten digits",
        note="section 5 takes a ramp for the signal: of its slope, fitted over the year, six digits take "
        f"{ramp:.2f} in the worst case",
    )


@CHECKS.add(entry("s4.monitored"))
def monitored() -> Finding:
    error = float(theory.worst_rate_error(PERIOD, SIX))
    free = theory.off_tuned_drift(DRIFTS[0], error)
    held = theory.phase_error_cost((DRIFTS[0], 0.0), error * PERIOD / 2)[1]
    return unverifiable(
        f"it would change the sample calculations, which let the phase run for a year: set anew at every turn, six "
        f"digits cost {held:.2f} mas a year across the geodetic drift in place of {free:.0f}",
        "how often the sensor is read, how well, and whether it sets the phase too, is not in the documents",
    )


@CHECKS.add(entry("s4.finite-wordlength"))
def finite_wordlength() -> Finding:
    errors = [experiment.rounded_rate_error(PERIOD, fmt) for fmt in (SIX, TEN)]
    return compare(
        all(errors),
        f"ω_r of 600 s is off by {scientific(errors[0], 3)} rad/s at six digits and {scientific(errors[1], 3)} at ten",
    )


@CHECKS.add(entry("s4.sample-1-t"))
def sample_period() -> Finding:
    rate = float(theory.roll_rate(600.0))
    return compare(
        prints_as(rate, ".01047", *Rounding.documented()),
        f"$2\\pi/600={rate:.6f}$ rad/s, as printed next",
        note="given",
    )


@CHECKS.add(entry("s4.sample-1-omega-r"))
def omega_r() -> Finding:
    rate = float(theory.roll_rate(PERIOD))
    return compare(prints_as(rate, ".01047", *Rounding.documented()), f"${rate * 10:.7f}\\times10^{{-1}}$")


@CHECKS.add(entry("s4.sample-1-places"), entry("s4.sample-1-delta-omega"))
def six_places() -> Finding:
    worst, real = float(theory.worst_rate_error(PERIOD, SIX)), experiment.rounded_rate_error(PERIOD, SIX)
    return compare(
        math.isclose(worst, 0.5e-7) and math.isclose(worst, 0.0000005e-1),
        f"half a unit of the sixth place is {scientific(worst, 2)} rad/s",
        note=f"the worst case; ω_r as it is is off by {scientific(real, 4)}",
    )


@CHECKS.add(entry("s4.sample-1-period"))
def period_1() -> Finding:
    period = 2 * math.pi / 0.5e-7
    return compare(prints_as(period, "1.2566e8", *Rounding.documented()), f"{scientific(period, 5)} s")


@CHECKS.add(entry("s4.sample-1-4-years"))
def four_years() -> Finding:
    years = 2 * math.pi / 0.5e-7 / YEAR
    return compare(round(years) == 4, f"{years:.2f} years")


@CHECKS.add(entry("s4.sample-1-pi-2"))
def quarter_turn() -> Finding:
    phase = 0.5e-7 * YEAR
    real = abs(experiment.rounded_rate_error(PERIOD, SIX)) * YEAR
    return compare(
        abs(phase / (math.pi / 2) - 1) < 0.01,
        f"{phase:.4f} rad, for $\\pi/2={math.pi / 2:.4f}$",
        note=f"the worst case; as ω_r rounds it is {real:.3f} rad",
    )


@CHECKS.add(entry("s4.sample-1-s-to-0"))
def s_to_zero() -> Finding:
    start, end = 0.5 * math.cos(0), 0.5 * math.cos(0.5e-7 * YEAR)
    return compare(
        start == 1 and abs(end) < 0.01,
        f"by (11) from {start:g} s to {end:.3f} s",
        Verdict.MISPRINT if start == 0.5 and abs(end) < 0.01 else Verdict.WRONG,
        otherwise_note="the factor ½ of (11) is left out; it only scales",
    )


@CHECKS.add(entry("s4.sample-1-severe"))
def severe() -> Finding:
    real = abs(experiment.rounded_rate_error(PERIOD, SIX))
    across = theory.off_tuned_drift(DRIFTS[0], real)
    lost = theory.off_tuned_loss(real)
    return compare(
        bool(lost > 0.01 and across > DRIFTS[1]),
        f"with ω_r as it rounds {100 * lost:.0f} % are lost at the end of the year; in two dimensions the geodetic "
        f"drift gives {across:.0f} mas a year across",
    )


@CHECKS.add(entry("s4.sample-2-places"))
def ten_places() -> Finding:
    worst, real = float(theory.worst_rate_error(PERIOD, TEN)), experiment.rounded_rate_error(PERIOD, TEN)
    return compare(
        math.isclose(worst, 0.5e-11),
        f"half a unit of the tenth place is {scientific(worst, 2)} rad/s",
        note=f"the worst case; ω_r as it is is off by {scientific(real, 4)}",
    )


@CHECKS.add(entry("s4.sample-2-delta-omega"))
def delta_omega_2() -> Finding:
    worst = float(theory.worst_rate_error(PERIOD, TEN))
    left, right = 0.0000000005e-1, 0.5e-11
    return compare(
        math.isclose(left, worst) and math.isclose(right, worst),
        f"{scientific(worst, 2)} rad/s; the left side is {scientific(left, 2)}, the right side {scientific(right, 2)}",
        Verdict.MISPRINT if math.isclose(right, worst) else Verdict.WRONG,
        otherwise_note="a zero is missing on the left; the right side, which is used, is right",
    )


@CHECKS.add(entry("s4.sample-2-period"))
def period_2() -> Finding:
    period = 2 * math.pi / 0.5e-11
    with_comma = float("1,2566".replace(",", "")) * 1e12
    return compare(
        math.isclose(period, with_comma, rel_tol=1e-4),
        f"{scientific(period, 5)} s",
        Verdict.MISPRINT if prints_as(period, "1.2566e12", *Rounding.documented()) else Verdict.WRONG,
        otherwise_note="a comma for the decimal point, by the author or the scan",
    )


@CHECKS.add(entry("s4.sample-2-40-000-years"))
def forty_thousand() -> Finding:
    years = 2 * math.pi / 0.5e-11 / YEAR
    return compare(abs(years / 40000 - 1) < 0.01, f"{years:.0f} years")


@CHECKS.add(entry("s4.sample-2-cosine"))
def cosine_2() -> Finding:
    value = math.cos(2 * math.pi / 40000)
    return compare(
        prints_as(value, ".999999987", *Rounding.documented()), f"{value:.11f}", note="chopped to nine digits in print"
    )


@CHECKS.add(entry("s4.sample-2-1-234e-6"))
def percent_2() -> Finding:
    value = 100 * 2 * math.sin(math.pi / 40000) ** 2
    return compare(prints_as(value, "1.234e-6", *Rounding.documented()), f"{scientific(value, 5)} %")


@CHECKS.add(entry("s4.sample-2-negligible"))
def negligible() -> Finding:
    worst = float(theory.worst_rate_error(PERIOD, TEN))
    real = abs(experiment.rounded_rate_error(PERIOD, TEN))
    across = [experiment.clean_drift_error((DRIFTS[0], 0.0), partial(np.multiply, e))[1] for e in (worst, real)]
    return compare(
        bool(max(across) < ALLOWED),
        f"in two dimensions the geodetic drift gives {across[0]:.2f} mas a year across in the worst case, and "
        f"{across[1]:.2f} with ω_r as it rounds",
        otherwise_note=f"negligible in one dimension only; hung1982 grants a single error {ALLOWED} mas",
    )


@CHECKS.add(entry("s4.conclusion"))
def conclusion() -> Finding:
    across = {
        t: abs(theory.off_tuned_drift(DRIFTS[0], float(theory.worst_rate_error(PERIOD, FloatFormat(10, t)))))
        for t in range(8, 15)
    }
    enough = min((t for t, error in across.items() if error < ALLOWED), default=max(across))
    return compare(
        across[enough] < ALLOWED,
        f"from {enough} digits on the worst case in two dimensions is below {ALLOWED} mas a year: {across[enough]:.2f}",
    )


# -- section 5: noise within the signal's band -------------------------------------------------------------


@CHECKS.add(entry("s5.ramp-signal"))
def ramp_signal() -> Finding:
    record = experiment.derolled_record(DRIFTS, 0.0, PERIOD, np.random.default_rng(0), 3600)
    rates = experiment.fit_drift(record["signal"])
    return compare(
        bool(np.allclose(rates, DRIFTS)), f"slopes {rates[0]:.1f} and {rates[1]:.1f} mas a year", note="a model"
    )


@CHECKS.add(entry("s5.ramp-transform"))
def ramp_transform() -> Finding:
    k, w, s = sp.symbols("k omega s", positive=True)
    laplace = sp.laplace_transform(k * derivation.TIME, derivation.TIME, s, noconds=True)
    value = laplace.subs(s, sp.I * w)
    return compare(
        bool(sp.simplify(value - k / w**2) == 0),
        "$-k/\\omega^2+i\\pi k\\,\\delta'(\\omega)$",
        Verdict.MISPRINT if sp.simplify(sp.Abs(value) - k / w**2) == 0 else Verdict.WRONG,
        otherwise_note="the sign, and the part at zero frequency; of the size alone the next line makes use",
    )


@CHECKS.add(entry("s5.ramp-psd"))
def ramp_density() -> Finding:
    cycles = np.array([10.0, 100.0])
    f = cycles / YEAR
    slopes = [
        float(np.diff(np.log(d))[0] / np.diff(np.log(f))[0])
        for d in (theory.ramp_density(1.0, YEAR, f), theory.printed_ramp_density(1.0, f))
    ]
    return compare(
        abs(slopes[0] - slopes[1]) < 0.01,
        f"of a year's record, from 10 to 100 cycles a year, the density falls with the power {slopes[0]:.2f} of "
        f"frequency, not {slopes[1]:.2f}: $2k^2T/\\omega^2$",
        otherwise_note="$k^2/\\omega^4$ is the squared size of a transform, no power density, and of an endless ramp; "
        "a record ends with a jump, and its spectrum reaches much farther",
    )


@CHECKS.add(entry("s5.spectrum-spread"))
def spread() -> Finding:
    def excess(cycles: float) -> float:
        return float(theory.ramp_density(1.0, 1.0, cycles) / theory.ramp_density(1.0, 1.0, 1e-9)) - 0.5

    half = optimize.brentq(excess, 0.01, 2.0)
    # A signal without a spread has nothing a whole number of cycles away; a ramp has 1/(pi m)^2 of its peak.
    beside = excess(1.0) + 0.5
    return compare(
        math.isclose(beside, math.pi**-2) and derivation.ramp_spectrum().holds_at(3),
        f"half of its peak at {half:.3f} cycles a record, $\\delta\\omega={2 * math.pi * half:.2f}/T$",
        note="so it is the length of the record that sets it",
    )


@CHECKS.add(entry("s5.figure-iii-3-a"))
def figure_3a() -> Finding:
    found = spectra()
    expected = theory.ramp_density(found.drift, found.duration, found.offset / found.duration) / 4
    near = abs(found.offset) <= 5
    ratio = found.line_signal[near] / expected[near]
    level = float(np.mean(found.line_noise) / theory.flicker_density(found.level, 1 / PERIOD))
    return compare(
        bool(np.all(abs(ratio - 1) < 0.05) and abs(level - 1) < 4 / math.sqrt(8 * len(found.offset))),
        f"next to $f_r$ the rolled signal is {ratio.min():.3f} to {ratio.max():.3f} of the theory, the "
        f"noise {level:.2f}",
        note=f"drawn from simulated data in the {CHAPTER}",
    )


@CHECKS.add(entry("s5.figure-iii-3-b"), entry("s5.inphase-noise"))
def figure_3b() -> Finding:
    found = spectra()
    level = float(np.mean(found.base_noise) / theory.flicker_density(found.level, 1 / PERIOD))
    error = 1 / math.sqrt(8 * len(found.base_noise))
    ratio = found.base_signal / theory.ramp_density(
        found.drift, found.duration, np.arange(1, len(found.base_signal) + 1) / found.duration
    )
    return compare(
        bool(abs(level - 1) < 4 * error and abs(ratio[0] - 1) < 0.01),
        f"the derolled noise at low frequency is ${level:.2f}\\pm{error:.2f}$ times $S(f_r)$",
        note="both parts of it, in phase and in quadrature, for there are two readouts",
    )


@CHECKS.add(entry("s5.not-completely"))
def not_completely() -> Finding:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    error = math.sqrt(float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, best)))
    rate = theory.drift_error_rolled(LEVEL, PERIOD_FLOWN)
    study = filter_study()
    return compare(
        bool(np.all(study.error > 4 * study.uncertainty) and error > 0 and rate > 0),
        f"at 200 mas/√Hz at the roll frequency, {error:.2f} mas stay behind the best low-pass filter, and {rate:.3f} "
        "mas a year behind a fit over the year",
    )


@CHECKS.add(entry("s5.optimum-bandwidth-claim"))
def optimum_exists() -> Finding:
    found = optimize.minimize_scalar(
        lambda log_b: float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, math.exp(log_b))),
        bounds=(math.log(1e-7), math.log(1e-2)),
        method="bounded",
    )
    best, closed = math.exp(found.x), theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    return compare(
        abs(best / closed - 1) < 1e-3 and derivation.filters().holds,
        f"$B=\\sqrt[3]{{k^2/(8N_0)}}={closed:.3g}$ Hz by the formula, {best:.3g} Hz by search",
        note="where the ramp is read behind the filter; a fit over the record needs no such choice",
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
        f"simulated rms errors at a third of the optimum, at it and at three times it: "
        f"{', '.join(f'{math.sqrt(p):.2f}' for p in poles)} mas, {worst:.1f} standard errors off theory at most; over "
        f"a year a signal-to-noise ratio of {10 * math.log10(snr):.0f} dB at {least:.2f} mas",
        f"{CHAPTER}, section on noise within the band",
    )


@CHECKS.add(entry("s6.references"))
def references() -> Finding:
    return unverifiable("", "the two works cited are not among the documents")
