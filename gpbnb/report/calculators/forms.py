"""Inputs and results of each calculator, and the chapters' functions that compute the same results in Python."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.calculators import derivation
from gpbnb.report.calculators.page import Calculator, Figure, Input, Line, Values
from gpbnb.report.integration import theory as integration
from gpbnb.report.kalman import report_bounds
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory as rolling

_BASE = Input("b", "Base b", 2, 1000, (2, 16), whole=True)
_PLACES = Input("t", "Digits t", 1, 90, (1, 60), whole=True)
_RULE = Input("chop", "Rounding", 0, 1, choices=("to nearest", "chopped"))


def _format(given: Values) -> FloatFormat:
    return FloatFormat(int(given["b"]), int(given["t"]), Rounding.CHOP if given["chop"] else Rounding.NEAREST)


# -- the unit roundoff -----------------------------------------------------------------------------


def _unit_reference(given: Values) -> dict[str, Any]:
    beta, n = _format(given).unit_roundoff, int(given["n"])
    return {
        "beta": beta,
        "sharper": beta / (1 + beta),
        "total": n * beta,
        "gamma": gamma(n, beta) if n * beta < 1 else math.nan,
    }


ROUNDING = Calculator(
    id="rounding",
    title="Unit roundoff",
    inputs=(_BASE, _PLACES, _RULE, Input("n", "Roundings in a row n", 1, 1e12, (1, 1e9), whole=True, log=True)),
    definitions=derivation.rounding_unit,
    columns=("relative error", "at most"),
    lines=(
        Line("one rounding, β", ("beta",)),
        Line("one rounding, sharper: β/(1+β)", ("sharper",)),
        Line("n roundings, to first order: nβ", ("total",)),
        Line("n roundings, always: γₙ", ("gamma",)),
    ),
    sentence="One rounding is off by at most β = {beta} of the result, {n} in a row by at most {gamma}.",
    figure=Figure(
        "t",
        "Relative error against digits",
        "relative error",
        (("gamma", "n roundings, γₙ"), ("beta", "one rounding, β")),
    ),
    examples={
        "ten decimal digits": {"b": "10", "t": "10", "chop": "to nearest", "n": "1000"},
        "four decimal digits, chopped": {"b": "10", "t": "4", "chop": "chopped", "n": "20"},
        "IEEE double": {"b": "2", "t": "53", "chop": "to nearest", "n": "1000000"},
        "six hexadecimal digits, chopped": {"b": "16", "t": "6", "chop": "chopped", "n": "1000"},
    },
    shown={"b": "b", "t": "t", "chop": "rounding", "n": "n", "beta": "β", "total": "nβ", "gamma": "γₙ"},
    reference=_unit_reference,
    formulas=("beta", "sharper", "gamma"),
    letters={"beta": r"\beta", "chop": r"\text{chop}", "sharper": r"\beta'", "gamma": r"\gamma_n", "total": r"n\beta"},
    missing={"gamma": "none: nβ is {total}; needed less than 1; use more digits or fewer operations"},
)


# -- the bound of the Kalman filter ----------------------------------------------------------------


def _kalman_reference(given: Values) -> dict[str, Any]:
    k, n, m = (int(given[name]) for name in "knm")
    x, u, goal = (Fraction(given[name]) for name in ("x", "u", "goal"))
    fmt = _format(given)
    memory = (
        -math.expm1(k * math.log(given["f"])) / (1 - given["f"])
        if 0 < given["f"] < 1
        else float(k if given["f"] else 1)
    )
    counts = [report_bounds.coefficients(k, n, m, **faults) for faults in report_bounds.CORRECTIONS.values()]
    last = counts[-1]
    pairs = [(c.first, Fraction(c.second)) for c in counts]
    pairs.append((last.first, min(Fraction(last.second), 2 * last.first * Fraction(memory))))
    result: dict[str, Any] = {"beta": fmt.unit_roundoff, "memory": memory}
    for i, (a, b) in enumerate(pairs, 1):
        size = a * x + b * u
        result |= {f"a{i}": a, f"b{i}": b, f"size{i}": size, f"bound{i}": size * fmt.unit_roundoff}
        result[f"digits{i}"] = report_bounds.precision_for_coefficient(size, goal, fmt.base, fmt.rounding)
    return result


_KALMAN_NAMES = (*report_bounds.CORRECTIONS, "and old inputs forgotten")

KALMAN = Calculator(
    id="kalman",
    title="The bound (125)",
    inputs=(
        Input("k", "Steps k", 1, 1e9, (1, 1e8), whole=True, log=True),
        Input("n", "States n", 1, 1000, (1, 50), whole=True),
        Input("m", "Measurements m", 1, 1000, (1, 20), whole=True),
        Input("x", "Norm of the state ‖xₖ‖", 1e-30, 1e30, (1e-6, 1e6), log=True),
        Input("u", "Norm of the inputs ‖u‖, unit of the state", 1e-30, 1e30, (1e-6, 1e6), log=True),
        Input(
            "f",
            "Norm of the closed loop ‖F‖",
            0,
            1,
            (0, 1),
            cure="when a closed loop expands, B of (122) grows as its power k − 1",
        ),
        _BASE,
        _PLACES,
        _RULE,
        Input("goal", "Allowed error, unit of the state", 1e-30, 1e30, (1e-6, 1e6), log=True),
    ),
    definitions=derivation.kalman_bound,
    columns=("(125)", "times β‖xₖ‖", "times β‖u‖", "error", "digits needed"),
    lines=tuple(
        Line(name, (f"a{i}", f"b{i}", f"bound{i}", f"digits{i}")) for i, name in enumerate(_KALMAN_NAMES, 1)
    ),
    sentence="As printed, (125) gives {bound1} and asks for {digits1} digits; with its errors corrected {bound4} and "
    "{digits4}; with old inputs forgotten {bound5} and {digits5}.",
    figure=Figure(
        "k",
        "Bound against steps",
        "error, unit of the state",
        (*((f"bound{i}", name) for i, name in enumerate(_KALMAN_NAMES, 1)), ("goal", "allowed error")),
    ),
    examples={
        "the closing example": {
            "k": "3153600", "n": "10", "m": "2", "x": "1", "u": "1", "f": "1",
            "b": "10", "t": "17", "chop": "to nearest", "goal": "1",
        },
        "the same with a closed loop that forgets": {
            "k": "3153600", "n": "10", "m": "2", "x": "1", "u": "1", "f": "0.999",
            "b": "10", "t": "17", "chop": "to nearest", "goal": "1",
        },
        "in IEEE double": {
            "k": "3153600", "n": "10", "m": "2", "x": "1", "u": "1", "f": "0.999",
            "b": "2", "t": "53", "chop": "to nearest", "goal": "0.001",
        },
        "a small filter for a minute": {
            "k": "6000", "n": "4", "m": "1", "x": "10", "u": "0.1", "f": "0.95",
            "b": "2", "t": "24", "chop": "to nearest", "goal": "0.01",
        },
    },
    shown={
        "k": "k", "n": "n", "m": "m", "x": "‖xₖ‖", "u": "‖u‖", "f": "‖F‖", "b": "b", "t": "t", "goal": "allowed",
        "bound1": "as printed", "digits1": "digits", "bound4": "corrected", "digits4": "digits",
        "bound5": "forgotten", "digits5": "digits",
    },
    reference=_kalman_reference,
    formulas=("bound1", "a1", "b1", "a3", "b3", "a4", "b4", "memory", "b5"),
    letters={
        "x": r"{\|x_k\|}", "u": r"{\|u\|}", "beta": r"\beta", "f": r"{\|F\|}", "memory": "s", "bound1": r"\text{error}",
        **{f"{letter}{i}": f"{letter}_{i}" for letter in "ab" for i in range(1, 6)},
    },
)  # fmt: skip


# -- off-tuned deroll ------------------------------------------------------------------------------


def _deroll_reference(given: Values) -> dict[str, Any]:
    fmt, duration = _format(given), given["duration"] * derivation.DAY
    error = rolling.worst_rate_error(given["period"], fmt)
    return {
        "rate": rolling.roll_rate(given["period"]),
        "error": error,
        "beat": 2 * math.pi / float(error) / YEAR,
        "phase": float(error) * duration,
        "lost": rolling.off_tuned_loss(float(error), duration),
        "across": rolling.off_tuned_drift(given["drift"], float(error), duration),
    }


DEROLL = Calculator(
    id="deroll",
    title="Off-tuned deroll",
    inputs=(
        Input("period", "Roll period (s)", 1e-3, 1e6, (1, 10000), log=True),
        _BASE,
        Input("t", "Places of the register t", 1, 60, (1, 30), whole=True),
        _RULE,
        Input("duration", "Duration (days)", 1e-3, 1e5, (1, 3650), log=True),
        Input("drift", "Drift (mas a year)", 1e-9, 1e9, (1, 10000), log=True),
    ),
    definitions=derivation.off_tuned,
    columns=("quantity, for the largest error of the rate", "value"),
    lines=(
        Line("roll rate (rad/s)", ("rate",)),
        Line("its error Δω (rad/s)", ("error",)),
        Line("period of the off-tuned signal, 2π/Δω (years)", ("beat",)),
        Line("phase at the end (rad)", ("phase",)),
        Line("loss of the signal at the end, one dimension (above 1: sign reversed)", ("lost",)),
        Line("cross drift, two dimensions (mas a year)", ("across",)),
    ),
    sentence="The roll rate may be off by {error} rad/s. If it is, the phase is off by {phase} rad after {duration} "
    "days; in one dimension the signal loses {lost} of its size (above 1, its sign is reversed); in two, a cross drift "
    "of {across} mas a year appears. Once the phase is off by more than half a turn, a smaller error of the rate can "
    "do more harm.",
    figure=Figure(
        "t",
        "Share of the signal lost by the end of the record, against the places of the register",
        "loss / signal",
        (("lost", "loss of the signal, one dimension"),),
    ),
    examples={
        "sample calculation 1": {
            "period": "600", "b": "10", "t": "6", "chop": "to nearest", "duration": "365", "drift": "6600",
        },
        "sample calculation 2": {
            "period": "600", "b": "10", "t": "10", "chop": "to nearest", "duration": "365", "drift": "6600",
        },
        "roll period as flown, 24 bits": {
            "period": "77.5", "b": "2", "t": "24", "chop": "to nearest", "duration": "365", "drift": "6600",
        },
        "roll period as flown, IEEE double": {
            "period": "77.5", "b": "2", "t": "53", "chop": "to nearest", "duration": "365", "drift": "6600",
        },
    },
    shown={
        "period": "roll period (s)", "b": "b", "t": "t", "error": "Δω (rad/s)", "beat": "2π/Δω (years)",
        "phase": "phase (rad)", "lost": "share lost", "across": "cross drift (mas a year)",
    },
    reference=_deroll_reference,
    formulas=("rate", "e", "error", "phase", "lost", "across"),
    letters={
        "period": "T_r", "rate": r"\omega_r", "error": r"\Delta\omega", "phase": r"\psi", "duration": "T", "drift": "k",
        "lost": r"\text{share lost}", "across": r"\text{cross drift}", "chop": r"\text{chop}",
    },
)  # fmt: skip


# -- digital integration ---------------------------------------------------------------------------


def _walk_reference(given: Values) -> dict[str, Any]:
    sigma, omega, rate = (given[name] for name in ("sigma", "omega", "rate"))
    return {
        "mu": omega / rate,
        "walk": float(integration.walk_factor(omega / rate)),
        "exact": integration.random_walk(sigma, omega, rate),
        "printed": integration.printed_random_walk(sigma, omega, rate),
        "ratio": float(integration.approximation_ratio(omega / rate)),
    }


INTEGRATION = Calculator(
    id="integration",
    title="Random walk of digital integration",
    inputs=(
        Input("sigma", "Rms of the input σₓ (any unit u)", 1e-15, 1e15, (1e-6, 1e6), log=True),
        Input("omega", "Bandwidth ω (rad/s)", 1e-15, 1e15, (1e-3, 1e6), log=True),
        Input("rate", "Iteration rate f (Hz)", 1e-15, 1e15, (1e-3, 1e6), log=True),
    ),
    definitions=derivation.random_walk,
    columns=("quantity", "value"),
    lines=(
        Line("μ = ω/f", ("mu",)),
        Line("random walk, (35) (u s per √s)", ("exact",)),
        Line("random walk, (39) (u s per √s)", ("printed",)),
        Line("(39) / (35)", ("ratio",)),
    ),
    sentence="The random walk is {exact} u s per √s. Equation (39) gives {printed}, which is {ratio} times as much.",
    figure=Figure(
        "rate",
        "Random walk against iteration rate",
        "random walk, u s per √s",
        (("exact", "(35), exact"), ("printed", "(39), for fast sampling")),
    ),
    examples={
        "fast sampling": {"sigma": "1", "omega": "1", "rate": "100"},
        "equal bandwidth and rate": {"sigma": "1", "omega": "100", "rate": "100"},
        "slow sampling": {"sigma": "1", "omega": "10000", "rate": "100"},
        "where (35) as printed has no correct digit": {"sigma": "1", "omega": "1e-9", "rate": "100"},
    },
    shown={
        "sigma": "σₓ (u)", "omega": "ω (rad/s)", "rate": "f (Hz)", "mu": "μ", "exact": "(35)", "printed": "(39)",
        "ratio": "(39)/(35)",
    },
    reference=_walk_reference,
    formulas=("walk", "exact", "printed"),
    letters={
        "mu": r"\mu", "walk": "L", "sigma": r"\sigma_x", "omega": r"\omega", "rate": "f",
        "exact": r"\sigma_{(35)}", "printed": r"\sigma_{(39)}",
    },
)  # fmt: skip

CALCULATORS = (ROUNDING, KALMAN, DEROLL, INTEGRATION)
