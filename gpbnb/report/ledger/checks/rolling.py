"""Ch. III of 1984, on rolling and derolling: true values of its names, and simulated records.

One standard holds for the whole chapter. Equations (1) to (4) and section 4, which says so, consider a one-dimensional
signal: what they state is judged for one signal. All other statements are about the experiment and are judged for its
pair of signals, (5) to (8). There, strength and signal-to-noise ratio mean those of each signal in its own channel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.derivation import hold
from gpbnb.report.ledger.judge import read
from gpbnb.report.ledger.statements import load_statements
from gpbnb.report.measurement import YEAR, spin_in_readout
from gpbnb.report.rolling import derivation, experiment, rotations, theory
from gpbnb.report.rolling.theory import DRIFTS, FLOWN_DENSITY, LEVEL, PERIOD, PERIOD_FLOWN

Names = dict[str, Any]
SIX, TEN = FloatFormat(10, 6), FloatFormat(10, 10)
ALLOWED = 0.15
"""Error of a single source in mas, from the text on Figure II-2 in hung1982, ch. II."""


# -- simulated records ----------------------------------------------------------------------------


@cache
def spectra() -> experiment.Spectra:
    """Return a short record, 600 turns, with the signal-to-noise ratio of a year."""
    samples = 36000
    return experiment.spectra(DRIFTS[1] * YEAR / (10.0 * samples), np.random.default_rng(3), 4, samples=samples)


@cache
def noise_spectrum() -> tuple[experiment.Spectrum, experiment.Slope]:
    found = experiment.noise_spectrum(np.random.default_rng(1), 2**17, 8, 2**15, bands=16)
    return found, experiment.fit_slope(found)


@cache
def stages() -> dict[str, np.ndarray]:
    """Return a drift with noise passed through (5)-(7), for 20 turns of 600 s."""
    return experiment.derolled_record((2e6, 1e6), 400.0, PERIOD, np.random.default_rng(2), 1200)


@cache
def filter_study() -> experiment.FilterStudy:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    rng = np.random.default_rng(8)
    return experiment.filter_study(DRIFTS[0], [best / 3, best, 3 * best], 8, rng, YEAR / 16)


@cache
def walk_errors() -> np.ndarray:
    """Return drift errors for 200 random walks of the roll rate, without resets and with one per 100 steps of 600 s."""
    return experiment.roll_rate_errors(DRIFTS[0], WALK, 200, 52560, 600.0, [None, 100], np.random.default_rng(9))


WALK = 3e-6 / YEAR**3
"""Intensity of a roll rate, rad²/s³, at which the phase is off by a milliradian after a year."""


def deviation(found: float, expected: float, error: float) -> float:
    """Return the difference in standard errors."""
    return (found - expected) / error


@cache
def expected_squares() -> np.ndarray:
    """Return the mean square error of each filter of the study: the square of its lag, plus the exact noise.

    The noise grows with the logarithm of time. It is taken at T/e, where the logarithm has its mean over a record of
    length T.
    """
    study, middle = filter_study(), round(YEAR / 16 / theory.INTERVAL / math.e)
    expected = []
    for weights in study.filters:
        lag = float(np.arange(len(weights)) @ weights) * theory.INTERVAL
        noise = theory.filtered_variance(weights, LEVEL, middle, PERIOD_FLOWN)
        expected.append((study.drift / YEAR * lag) ** 2 + noise)
    return np.array(expected)


# -- section 1: signal and noise ------------------------------------------------------------------


def fixed(value: Any) -> Any:
    """Return a signal as a function of time, with its value at the time of a case."""
    return lambda time: value


_NUMBERS = (
    ("7/5", "-2/3", "11/4", "3/7", "5/6", "2/9", "4/3"),
    ("-3", "5/2", "1/3", "-6/5", "9/7", "7/4", "3/8"),
)


@cache
def signals() -> tuple[Names, ...]:
    """Return two instants with different signals, noises and angles, and the model's results for them."""
    return tuple(map(_instant, _NUMBERS))


def _instant(numbers: tuple[str, ...]) -> Names:
    s_x, s_y, n_1, n_2, rate, time, theta = map(sp.Rational, numbers)
    phase = rate * time
    rolled, carrier = complex_pair(s_x, s_y, -phase), sp.cos(phase)
    m_1, m_2 = rolled[0] + n_1, rolled[1] + n_2
    s_3, s_4 = complex_pair(m_1, m_2, phase)
    in_time = {
        "s": s_x, "n": n_1, "c": carrier, "d": sp.cos(phase + theta), "s_1": s_x * carrier, "m": s_x * carrier + n_1,
        "n_1": n_1, "n_2": n_2, "m_1": m_1, "m_2": m_2, "s_3": s_3, "s_4": s_4,
    }  # fmt: skip
    return {name: fixed(value) for name, value in in_time.items()} | {
        "matrix": sp.Matrix, "t": time, "omega_r": rate, "theta": theta, "Deltaomega": sp.Rational(2, 11),
        "s_x": s_x, "s_y": s_y, "rolled": rolled,
    }  # fmt: skip


def complex_pair(x: sp.Expr, y: sp.Expr, angle: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return real and imaginary part of (x + iy) e^{i angle}."""
    return x * sp.cos(angle) - y * sp.sin(angle), x * sp.sin(angle) + y * sp.cos(angle)


def low_frequency(signal: sp.Expr, offset: sp.Expr) -> sp.Expr:
    """Return the mean over the roll phase, which a filter keeps of a signal rolled and derolled with a phase offset."""
    return _mean_of_product().subs(_OFFSET, offset) * signal


_OFFSET = sp.Symbol("offset", real=True)


@cache
def _mean_of_product() -> sp.Expr:
    angle = sp.Symbol("angle", real=True)
    product = sp.expand(sp.cos(angle) * sp.cos(angle + _OFFSET), trig=True)
    return sp.integrate(product, (angle, 0, 2 * sp.pi)) / (2 * sp.pi)


def with_pair() -> list[Names]:
    """Return the instants with the pair of signals, and what rolling makes of it."""
    return [
        {**names, "s_x": fixed(names["s_x"]), "s_y": fixed(names["s_y"]), "s_1": fixed(names["rolled"][0]),
         "s_2": fixed(names["rolled"][1])}
        for names in signals()
    ]  # fmt: skip


def density_of_noise() -> Names:
    """How the density of the generated noise varies, and where both noise and signal are strongest."""
    found, slope = noise_spectrum()
    slopes = {"inversely proportional to the frequency": -1, "independent of the frequency": 0,
              "proportional to the frequency": 1}  # fmt: skip
    heaviest = int(np.argmax(found.density)) == 0 == int(np.argmax(spectra().ramp))
    return {"density": {name for name, each in slopes.items() if abs(slope.value - each) < 3 * slope.error},
            "place": "near the zero frequency" if heaviest else "elsewhere", "slope": slope}  # fmt: skip


def much_less() -> Names:
    found = spectra()
    simulated = float(found.noise[0] / np.mean(found.line_noise))
    year = float(theory.flicker_density(LEVEL, 1 / YEAR) / theory.flicker_density(LEVEL, 1 / PERIOD))
    ratio = min(simulated, year)
    return {"density": "much less" if ratio > 100 else "much more" if ratio < 0.01 else "the same", "year": year,
            "simulated": simulated, "turns": found.duration / PERIOD}  # fmt: skip


def equivalent() -> Names:
    """Rolling moves the spectrum of the signal to the roll frequency, and derolling moves it back."""
    found = stages()
    turn = np.exp(1j * theory.roll_phase(np.arange(1200), PERIOD))
    error = [float(np.max(abs(found["rolled"] * factor - found["signal"]))) for factor in (turn, 1 / turn)]
    peak = abs(np.fft.fftfreq(1200)[np.argmax(abs(np.fft.fft(found["rolled"])))] * 1200)
    undone = error[0] < 1e-12 * np.max(abs(found["signal"])) < error[1]
    return {"rolling": "modulation" if 18 <= peak <= 22 else "demodulation", "peak": peak,
            "derolling": "demodulation" if undone else "modulation"}  # fmt: skip


def best_phase() -> Names:
    best = max(range(-90, 181, 45), key=lambda angle: low_frequency(sp.S.One, sp.pi * angle / 180))
    angles = {"θ = 0": 0, "θ = π/2": 90, "θ = π": 180}
    return {"angle": {name for name, angle in angles.items() if angle == best},
            "demodulation": "synchronous" if best == 0 else "asynchronous"}  # fmt: skip


@cache
def recursion() -> tuple[rotations.Rotation, bool]:
    """Return a product of rounded rotations, and whether each rotation is the previous one times a fixed one."""
    n, step = sp.symbols("n delta", real=True)
    one_more = derivation.deroll(step) * derivation.deroll(n * step) - derivation.deroll((n + 1) * step)
    found = rotations.recursion(TEN, PERIOD, (60, 3600))
    bound = [theory.recursion_bound(int(steps), TEN.unit_roundoff) for steps in found.step]
    return found, bool(sp.simplify(one_more) == sp.zeros(2, 2) and np.all(found.size <= bound))


def recursively() -> Names:
    found, recursive = recursion()
    return {"deroll": "a recursively computed" if recursive else "a constant", "size": found.size}


def kept_band() -> Names:
    """Which band the last step keeps: the drifts of a record without noise, fitted again."""
    record = experiment.derolled_record((2e6, 1e6), 0.0, PERIOD, np.random.default_rng(0), 1200)
    rates = experiment.fit_drift(record["derolled"])
    low = np.allclose(rates, (2e6, 1e6), rtol=1e-9)
    return {"kept": "low frequency" if low else "high frequency", "rates": rates}


TURNS, SAMPLES = 20, 1200


def rolled_spins() -> np.ndarray:
    """Return the readings (4, samples) of four gyros with different drift angles during 20 turns, as complex pairs."""
    phase = theory.roll_phase(np.arange(SAMPLES), PERIOD)
    spins = np.array([[0.0, 3.0, 1.0], [0.0, -2.0, 4.0], [0.0, 5.0, -6.0], [0.0, 1.0, 2.0]]) * 1e-5
    none = np.zeros(3)
    read = [spin_in_readout(spin, none, none, phase) for spin in spins]
    return np.array([each[:, 1] + 1j * each[:, 2] for each in read])


def carriers() -> Names:
    """Count the gyros with constant drift angles whose readings have their spectrum at the roll frequency."""
    transforms = np.abs(np.fft.fft(rolled_spins(), axis=1))
    peaks = np.abs(np.fft.fftfreq(SAMPLES)[np.argmax(transforms, axis=1)]) * SAMPLES
    modulated = int(np.sum(np.abs(peaks - TURNS) < 0.5))
    gyros = {"each": 4, "one single": 1}
    return {"gyros": {name for name, count in gyros.items() if count == modulated}, "modulated": modulated,
            "count": len(peaks)}  # fmt: skip


def angles_seen() -> Names:
    """On how many angles of the spin axis the readings of a gyro depend."""
    h, none = 1e-6, np.zeros(3)
    columns = [
        spin_in_readout(none + step, none, none, 0.4) - spin_in_readout(none - step, none, none, 0.4)
        for step in h * np.eye(3)
    ]
    count = int(np.linalg.matrix_rank(np.array(columns) / h, tol=1e-6))
    return {"signal": {1: "one signal", 2: "a pair of signals", 3: "three signals"}[count], "count": count}


# -- section 2: the five sources ------------------------------------------------------------------


def five_sources() -> Names:
    found = {
        "phase of 1°": theory.phase_error_cost(DRIFTS, math.radians(1))[1],
        "frequency, ten digits": theory.off_tuned_drift(DRIFTS[0], 5e-12),
        "noise at the roll frequency": theory.drift_error_rolled(LEVEL, PERIOD),
        "filter at its best (mas)": math.sqrt(filter_study().error.min()),
        "roll rate": theory.rate_walk_error(DRIFTS[0], WALK),
    }
    text = "; ".join(f"{name}: {value:.3g}" for name, value in found.items())
    some = min(map(abs, found.values())) > 0
    return {"sources": "potential error sources" if some else "harmless variations", "text": text}


def law() -> Names:
    long, short = (float(theory.flicker_density(LEVEL, 1 / period)) for period in (PERIOD, PERIOD / 2))
    _, slope = noise_spectrum()
    falls = math.isclose(long / short, 2) and abs(slope.value + 1) < 3 * slope.error
    return {"law": "1/f" if falls else "1/T", "ratio": long / short}


def sections_of_sources() -> Names:
    """Find the sections on the first sources: those besides the introduction, the list and the references."""
    found = sorted({e.section for e in load_statements() if e.id.startswith("hung1984.III.s")} - {"1", "2", "6"})
    return {"sources": {2: "two", 3: "three", 5: "five"}.get(len(found), ""), "sections": ", ".join(found)}


def sources_4_and_5() -> tuple[float, float, float]:
    """Return how far simulated filters and roll rates are from theory, in standard errors, and what resets gain."""
    study = filter_study()
    filters = float(np.max(abs(study.error - expected_squares()) / study.uncertainty))
    sizes = np.sqrt(np.mean(walk_errors() ** 2, axis=1))
    expected = [theory.rate_walk_error(DRIFTS[0], WALK, reset=reset) for reset in (None, 60000.0)]
    walks = max(abs(deviation(s, e, e / math.sqrt(400))) for s, e in zip(sizes, expected, strict=True))
    return filters, walks, expected[0] / expected[1]


# -- section 3: a phase between roll and deroll ---------------------------------------------------


def largest_phase() -> float:
    """Return the constant error of the roll angle that costs a milliarcsecond a year; arcseconds."""
    return math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600


def phase_error() -> Names:
    cost = experiment.clean_drift_error(DRIFTS, lambda t: np.full(t.shape, math.radians(1)))
    harmless = bool(np.max(abs(cost)) < ALLOWED)
    return {"error": "does not directly introduce any error" if harmless else "directly introduces an error",
            "cost": cost}  # fmt: skip


def signal_to_noise() -> Names:
    """Find the ratio of each signal in its own channel, for drifts fitted over 100 turns and exact noise."""
    slope = theory.slope_weights(6000)
    phase = theory.roll_phase(np.arange(6000), PERIOD)
    angles = np.radians([0, 1, 60])
    # a channel is n_1 cos - n_2 sin, and the two noises are independent
    noise = [sum(theory.variance_of_sum(slope * f(phase + a), LEVEL) for f in (np.cos, np.sin)) for a in angles]
    own = [float(theory.rotation(angle)[0, 0]) ** 2 for angle in angles]
    kept = [part * noise[0] / variance for part, variance in zip(own, noise, strict=True)]
    pair = theory.rotation(math.radians(60)) @ np.array(DRIFTS)
    predicted = all(abs(ratio / math.cos(angle) ** 2 - 1) < 1e-3 for ratio, angle in zip(kept, angles, strict=True))
    return {"ratio": "" if not predicted else "a reduction" if kept[2] < 1 else "an increase", "kept": kept,
            "both": math.hypot(*pair) / math.hypot(*DRIFTS)}  # fmt: skip


def small_angles() -> Names:
    """Find the angles at which a signal loses less power than .0004."""
    degrees = {"one degrees": 1, "two degrees": 2, "five degrees": 5, "ten degrees": 10}
    return {"angle": {name for name, angle in degrees.items() if math.sin(math.radians(angle)) ** 2 < 0.0004}}


def four_digits(angle: sp.Expr) -> sp.Rational:
    """Return a cosine to four decimals, as in the report."""
    return sp.Rational(round(sp.N(sp.cos(angle), 30) * 10**4), 10**4)


def lost_power() -> Names:
    """Return the power that a signal loses at one degree and the limit that four-digit numbers give it, in percent."""
    lost = 100 * (1 - float(theory.rotation(math.radians(1))[0, 0]) ** 2)
    rounded = Fraction(round((1 - Fraction(9998, 10**4) ** 2) * 10**4), 10**2)
    return {"limit": rounded if lost < rounded else Fraction(0), "lost": lost}


# -- section 4: a wrong deroll frequency ----------------------------------------------------------


def half_unit(fmt: FloatFormat) -> Fraction:
    """Return half a unit in the last place of ω_r in rad/s; its first digit is the second decimal."""
    return Fraction(1, 10) * Fraction(1, 2) / Fraction(10) ** fmt.precision


def real_error(fmt: FloatFormat) -> float:
    """Return the rounding error of ω_r in a format, in rad/s."""
    rate = theory.roll_rate(PERIOD)
    return float(fmt.round(rate) - rate)


def of_rate(fmt: FloatFormat) -> Names:
    """Return the numbers of a sample calculation, for a rate that is wrong by half a unit of its last place."""
    offset, rate = half_unit(fmt), theory.roll_rate(PERIOD)
    period = 2 * math.pi / float(offset)
    return {"omega_r": float(rate), "T": PERIOD, "pi": math.pi, "Deltaomega": float(offset), "t": YEAR,
            "T_Deltaomega": period, "period": period, "start": "0", "numbers": float}  # fmt: skip


def worst_is_half_a_unit(fmt: FloatFormat) -> bool:
    return math.isclose(half_unit(fmt), theory.worst_rate_error(PERIOD, fmt))


def various_degrees() -> Names:
    errors = {t: float(theory.worst_rate_error(PERIOD, FloatFormat(10, t))) for t in range(6, 11)}
    lost = [theory.off_tuned_loss(error) for error in errors.values()]
    depends = all(a > b for a, b in pairwise(lost))
    return {
        "effect": "to various degrees depending on its size" if depends else "to the same degree whatever its size",
        "lost": ", ".join(f"{part:.1g}" for part in lost),
        "ramp": 1 - float(theory.fitted_drift((1.0, 0.0), partial(np.multiply, errors[6]))[0]),
    }  # fmt: skip


def ideal_offset() -> Names:
    """At which frequency offsets the extracted signal stays what it is at the start, by (11)."""
    kept = {
        name: all(low_frequency(n["s"](0), k * n["t"]) == low_frequency(n["s"](0), 0) for n in signals())
        for name, k in (("Δω = 0", 0), ("Δω = 1", 1), ("Δω = −1", -1))
    }
    return {"offset": {name for name, same in kept.items() if same}}


def signal_in_a_year() -> list[Names]:
    """Return the cosine at the start, and by (11) the signal at the start and, to two decimals, after a year."""
    start, end = (float(low_frequency(sp.S.One, sp.Float(float(half_unit(SIX)) * t))) for t in (0.0, YEAR))
    return [
        {"cosine at the start": 2 * start, "part": 1},
        {"part": 2, "t": 0.0, "s": fixed(1.0), "s_hat": fixed(start), "numbers": float, "start": start, "end": end},
        {"part": 3, "t": YEAR, "s": fixed(1.0), "s_hat": fixed(round(end, 2)), "numbers": float},
    ]


_PLAIN = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


def is_period(phrase: str) -> bool:
    """Whether a printed number of seconds, with the comma for thousands, is the period of the offset of ten digits."""
    significand, power = phrase.translate(_PLAIN).split(" × 10")
    printed = float(significand.replace(",", "")) * 10.0 ** int(power)
    return math.isclose(2 * math.pi / float(half_unit(TEN)), printed, rel_tol=1e-4)


def cosine_after_a_year() -> Names:
    """Return the cosine of the phase that the offset of ten digits gives in a year, and no other cosine."""
    angle = 2 * math.pi / round(2 * math.pi / float(half_unit(TEN)) / YEAR, -4)
    cosine: Callable[[float], float] = lambda x: math.cos(x) if math.isclose(x, angle) else 0.0  # noqa: E731
    return {"cos": cosine, "sin": math.sin, "pi": math.pi, "numbers": float, "value": math.cos(angle)}


@cache
def negligible() -> Names:
    worst = float(theory.worst_rate_error(PERIOD, TEN))
    drifts = (worst, abs(real_error(TEN)))
    across = [experiment.clean_drift_error((DRIFTS[0], 0.0), partial(np.multiply, e))[1] for e in drifts]
    lost = theory.off_tuned_loss(worst) * DRIFTS[0]
    return {"effect": "negligible" if lost < ALLOWED else "not negligible", "lost": lost, "across": across}


@cache
def enough_digits() -> Names:
    across = {
        t: abs(theory.off_tuned_drift(DRIFTS[0], float(theory.worst_rate_error(PERIOD, FloatFormat(10, t)))))
        for t in range(8, 15)
    }
    enough = min((t for t, error in across.items() if error < ALLOWED), default=max(across))
    return {"problem": "can be eliminated" if across[enough] < ALLOWED else "cannot be eliminated", "enough": enough,
            "error": across[enough]}  # fmt: skip


# -- section 5: noise within the signal's band ----------------------------------------------------


def ramp_transform() -> Names:
    k, w, s = sp.symbols("k omega s", positive=True)
    laplace = sp.laplace_transform(k * derivation.TIME, derivation.TIME, s, noconds=True)
    return {"k": k, "omega": w, "s": fixed(laplace.subs(s, sp.I * w)), "numbers": sp.Rational}


def ramp_densities() -> list[Names]:
    """Return the density of a ramp of a year at 10 and 100 cycles a year."""
    return [
        {"k": 3.0, "omega": 2 * math.pi * cycles / YEAR, "T": YEAR, "numbers": float, "close": 0.01,
         "phi_SS": fixed(float(theory.ramp_density(3.0, YEAR, cycles / YEAR)) * YEAR**2)}
        for cycles in (10.0, 100.0)
    ]  # fmt: skip


def slope_of_density() -> float:
    low, high = (names["phi_SS"](0) for names in ramp_densities())
    return math.log10(high / low)


def spread() -> Names:
    def excess(cycles: float) -> float:
        return float(theory.ramp_density(1.0, 1.0, cycles) / theory.ramp_density(1.0, 1.0, 1e-9)) - 0.5

    half = scipy.optimize.brentq(excess, 0.01, 2.0)
    # At a distance of m cycles, a constant signal has no density, and a ramp has 1/(pi m)^2 of its peak.
    beside = excess(1.0) + 0.5
    return {"spread": "nonzero" if math.isclose(beside, math.pi**-2) else "zero", "half": half}


def inphase_noise() -> Names:
    found = spectra()
    level = float(np.mean(found.base_noise) / theory.flicker_density(LEVEL, 1 / PERIOD))
    error = 1 / math.sqrt(8 * len(found.base_noise))
    return {"noise": "the inphase components" if abs(level - 1) < 4 * error else "no components", "level": level,
            "error": error}  # fmt: skip


def not_completely() -> Names:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    error = math.sqrt(float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, best)))
    rate, study = theory.drift_error_rolled(LEVEL, PERIOD_FLOWN), filter_study()
    stays = bool(np.all(study.error > 4 * study.uncertainty) and error > 0 and rate > 0)
    return {"noise": "cannot be suppressed completely" if stays else "can be suppressed completely", "error": error,
            "rate": rate}  # fmt: skip


def optimum_exists() -> Names:
    found = scipy.optimize.minimize_scalar(
        lambda log_b: float(theory.filtered_error(DRIFTS[0], FLOWN_DENSITY, math.exp(log_b))),
        bounds=(math.log(1e-7), math.log(1e-2)),
        method="bounded",
    )
    best, closed = math.exp(found.x), theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    one = abs(best / closed - 1) < 1e-3 and hold(derivation.filters())
    return {"choice": "an optimum choice" if one else "every choice", "closed": closed, "best": best}


def optimum() -> Names:
    """Compare simulated filters of a third, one and three times the optimum bandwidth with theory."""
    study = filter_study()
    poles = study.error[:3]
    worst = float(np.max(abs(study.error - expected_squares()) / study.uncertainty))
    ratio = float(theory.signal_to_noise(DRIFTS[0], YEAR, poles[1]))
    return {"right": bool(worst < 4 and np.argmin(poles) == 1), "worst": worst, "least": math.sqrt(poles[1]),
            "errors": ", ".join(f"{math.sqrt(p):.2f}" for p in poles), "decibels": 10 * math.log10(ratio)}  # fmt: skip


CHECKS = read(__name__, globals())
