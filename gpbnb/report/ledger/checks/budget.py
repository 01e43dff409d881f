"""Chapters I and II of hung1982, title and ch. I of hung1984: contracts, classes of errors, and the error budget."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from datetime import date, datetime, timedelta
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.report.budget import derivation, experiment, theory
from gpbnb.report.budget.theory import ErrorForm, Kind
from gpbnb.report.display.derivation import hold
from gpbnb.report.ledger.checks import rolling
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.judge import read
from gpbnb.report.ledger.statements import Statement, load_statements, quote, statement
from gpbnb.report.measurement import (
    ARCSEC,
    MAS,
    STATES,
    Floats,
    apply,
    deroll,
    measurement_matrix,
    rotation,
    spin_in_readout,
)

Names = Mapping[str, Any]

# -- contracts, chapters and dates ----------------------------------------------------------------


def printed_in(document: str) -> list[Statement]:
    return [each for each in load_statements() if each.document == document]


def where(document: str, item: str) -> str:
    """Return the chapter of the statements with this name."""
    (found,) = {each.chapter for each in printed_in(document) if each.item == item}
    return found


@cache
def open_studies() -> tuple[int, int]:
    """Return how many of the studies that ch. III leaves open are answered, and their number."""
    left = [each for each in printed_in("hung1984") if each.chapter == "III" and each.kind == "open"]
    return sum(rolling.CHECKS.run(each).verdict is Verdict.ANSWERED for each in left), len(left)


def day(printed: Statement, word: str) -> date:
    """Return a printed day, which may not exist."""
    return date(*(int(printed.number(f"{word} {part}").value) for part in ("year", "month", "day")))


def span(start: date, end: date) -> tuple[int, int]:
    """Return whole months and remaining days from `start` to `end`."""
    months = 12 * (end.year - start.year) + end.month - start.month - (end.day < start.day)
    later = start.year * 12 + start.month - 1 + months
    return months, (end - date(later // 12, later % 12 + 1, start.day)).days


def period(printed: Statement) -> Names:
    """Return whole months and days of a printed period with its last day, by which its duration is judged."""
    try:
        months, days = span(day(printed, "from"), day(printed, "to") + timedelta(days=1))
    except ValueError:
        months, days = 0, 0
    return {"duration": months, "months": months, "days": days, "part": 1}


def previous_contract(printed: Statement) -> Names:
    """Return when the contract can have been awarded, and its number, from the first reference of ch. II."""

    def month(text: str) -> date:
        return datetime.strptime(text, "%B %Y").date()

    listed = quote("hung1982.II.references")
    issued = datetime.strptime(re.findall(r"\d+ [A-Z]\w+ \d{4}", listed)[0], "%d %B %Y").date()
    start = day(intended("hung1982.I.report-period"), "from")
    (number,) = re.findall(r"NAS8-\d+", listed)
    return {
        "award": lambda text: month(text) < issued < start,
        "contract": number,
        "months": (span(month(printed.says("award")), issued)[0], span(issued, start)[0]),
    }


def classifications() -> list[str]:
    names = (each.id for each in printed_in("hung1982"))
    return [name.rpartition("-")[2] for name in names if name.startswith("hung1982.II.classification-by-")]


# -- classes of errors, and their reduction -------------------------------------------------------


def by_statistics() -> Names:
    """Whether each error, known or not and constant or not, belongs to exactly one class."""

    def classes(known: bool, constant: bool) -> list[Kind]:
        unknown = {Kind.CONSTANT: not known and constant, Kind.PROCESS: not known and not constant}
        return [kind for kind in Kind if {Kind.DETERMINISTIC: known, **unknown}[kind]]

    complete = [len(classes(*case)) for case in itertools.product((True, False), repeat=2)] == [1] * 4
    return {"the three types": "cover every error" if complete else "leave errors out"}


def by_form() -> Names:
    outside = without_form()
    return {"the four forms": "leave errors out" if outside else "cover every error", "outside": ", ".join(outside)}


def without_form() -> list[str]:
    """List misalignments whose effect on the gyro's readings is not a bias, a drift, a pointing or a scale factor."""
    phase = np.linspace(0, 6, 7)
    # the drift changes from phase to phase, so it cannot compensate a constant rotation
    nominal = np.array([0.0, 3e-5, 2e-5]) * np.linspace(1, 2, 7)[:, None]

    def rank(*names: str) -> int:
        matrix = measurement_matrix(phase, names, nominal_theta=nominal).reshape(-1, len(names))
        return int(np.linalg.matrix_rank(matrix / np.linalg.norm(matrix, axis=0)))

    forms = ("phi2", "phi3", "bias_y", "bias_z", "scale")
    angles = [name for name in STATES if name.startswith(("beta", "gamma"))]
    return [name for name in angles if rank(*forms, name) > rank(*forms)]


def compensated(part: float) -> float:
    """Return the error of the spin axis after rotating back by part of a misalignment of 20 arcseconds; radians."""
    theta, gamma = np.array([0.0, 9.0, 4.0]) * ARCSEC, np.array([0.0, 20.0, 0.0]) * ARCSEC
    read = spin_in_readout(theta, np.zeros(3), gamma, 0.3)
    back = deroll(apply(rotation(-part * gamma), read)[1:], 0.3)
    return float(np.abs(back - rotation(theta)[1:, 0]).max())


def compensation() -> Names:
    known, nearly = (compensated(part) / MAS for part in (1.0, 0.99))
    said = "can be compensated" if known < 1e-6 else "cannot be compensated"
    return {"this type": said, "known": known, "nearly": nearly}


def averaging() -> Names:
    """What remains of a constant after whole rolls and after an incomplete one, by theory and by simulation."""
    rolls, orbits = theory.cycles_factor(52560), theory.cycles_factor(52560.3)
    simulated = math.isclose(rolled_mean(), theory.cycles_factor(10.3), rel_tol=1e-5)
    right = rolls == 0 and orbits < 1e-4 and simulated and derivation.averages()[1].holds
    said = "removes some of them" if right else "removes none of them"
    return {"averaging": said, "rolls": rolls, "orbits": orbits}


@cache
def rolled_mean() -> float:
    """Return the simulated mean of a constant that rotates 10.3 times."""
    return float(experiment.turning_mean(10.3))


@cache
def processes() -> Names:
    """Return the part of a process left in means over 30 correlation times and over 0.1."""
    trials, ratio = 4000, 30.0
    means = experiment.correlated_means(ratio, 1.0, trials, np.random.default_rng(1982))
    left, slow = theory.correlated_factor(ratio, 1.0), theory.correlated_factor(0.1, 1.0)
    # four standard errors of a standard deviation; the rule of 400 points is 2.4e-4 off
    agree = abs(float(np.sqrt(np.mean(means**2))) / left - 1) < 4 / math.sqrt(2 * trials) + 2.4e-4
    right = agree and left < 0.5 and hold(derivation.averages())
    said = "reduces some of their effect" if right else "reduces nothing"
    return {"averaging or filtering": said, "left": left, "slow": slow}


def scale_factor() -> Names:
    right = identifiable(20 * ARCSEC) and not identifiable(0.0)
    return {"Kalman filtering": "may identify it" if right else "cannot identify it"}


def identifiable(amplitude: float) -> bool:
    """Whether a year of readings with a known signal of this size determines scale factor, drift, rate and biases."""
    time = np.arange(200) / 200
    theta = np.zeros((200, 3))
    theta[:, 1] = amplitude * np.sin(2 * np.pi * time)
    names = ("phi2", "phi3", "bias_y", "bias_z", "scale")
    H = measurement_matrix(2 * np.pi * 31.3 * time, names, nominal_theta=theta)
    full: Floats = np.concatenate([H, H[..., :2] * time[:, None, None]], axis=-1).reshape(-1, 7)
    size = np.linalg.norm(full, axis=0)
    return bool(np.linalg.matrix_rank(full / np.where(size, size, 1)) == 7)


@cache
def filtered_noise() -> tuple[float, float, int]:
    """Return error of a filter for a constant in white noise / error of one reading, expected √(1/N), trials."""
    rng = np.random.default_rng(44)
    readings, trials = 400, 2000
    estimate, variance = np.zeros(trials), 1e12
    for _ in range(readings):
        gain = variance / (variance + 1.0)
        estimate += gain * (rng.standard_normal(trials) - estimate)
        variance *= 1 - gain
    return float(np.sqrt(np.mean(estimate**2))), theory.white_factor(readings), trials


def noise() -> Names:
    left, expected, trials = filtered_noise()
    right = abs(left / expected - 1) < 4 / math.sqrt(2 * trials) and expected < 0.5  # four standard errors
    return {"Kalman filtering": "may help" if right else "does not help", "left": left, "expected": expected}


# -- Table II-1 and Figure II-2 -------------------------------------------------------------------


TOTAL = float(statement("hung1982.II.rss-total").number("total").value)
"""The printed total of Table II-1, in milliarcseconds."""
SOURCES, EACH = (float(statement("hung1982.II.44-sources").number(name).value) for name in ("sources", "each"))
"""The printed number of equal sources, and the error of each in milliarcseconds."""


def equal_sources(printed: Statement) -> Names:
    """Return how many errors of the printed size reach the goal, and which error of the printed number does."""
    goal = float(statement("hung1982.II.rss-basis").number("total").value)
    size, count = (abs(printed.number(name).value) for name in ("each", "sources"))
    largest = theory.equal_error(goal, float(count))
    return {
        "sources": Fraction(theory.equal_sources(goal, float(size))),
        "each": Fraction(largest),
        "largest": largest,
        "size": float(size),
        "count": int(count),
    }


def stray_classes(printed: Statement) -> str:
    """List the classes of the abbreviations that are not in the lists of the text."""
    classes = {kind.value.replace("constant", "variable") for kind in Kind} | {form.value for form in ErrorForm}
    return ", ".join(sorted(set(printed.says("the classes").split(", ")) - classes))


CHECKS = read(__name__, globals())
