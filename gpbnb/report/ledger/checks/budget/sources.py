"""Error sources, their classes and their budget: hung1982, ch. II."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.arithmetic.formats import prints_as
from gpbnb.report.budget import derivation, experiment, theory
from gpbnb.report.budget.theory import ErrorForm, Kind
from gpbnb.report.ledger.checks.budget.registry import CHAPTER, CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given, unverifiable
from gpbnb.report.ledger.statements import Statement, statement
from gpbnb.report.measurement import ARCSEC, MAS, STATES, apply, deroll, measurement_matrix, rotation, spin_in_readout

# -- hung1982, ch. II: figures and classes --------------------------------------------------------


@CHECKS.add("hung1982.II.classification-by-statistics")
def by_statistics(printed: Statement) -> Finding:
    def classes(known: bool, constant: bool) -> list[Kind]:
        holds = {
            Kind.DETERMINISTIC: known,
            Kind.CONSTANT: not known and constant,
            Kind.PROCESS: not known and not constant,
        }
        return [kind for kind in Kind if holds[kind]]

    complete = [len(classes(*case)) for case in itertools.product((True, False), repeat=2)] == [1] * 4
    return compare(
        printed.claims("the three types", {"cover every error": complete, "leave errors out": not complete}),
        "each error, known or unknown, constant or varying, belongs to exactly one class",
        note="1/f noise, which Table II-1 lists separately, is a random process",
    )


@CHECKS.add("hung1982.II.classification-by-form")
def by_form(printed: Statement) -> Finding:
    outside = without_form()
    return compare(
        printed.claims("the four forms", {"cover every error": not outside, "leave errors out": bool(outside)}),
        (
            f"for {', '.join(outside)}, the columns of the measurement matrix are not sums of the columns "
            "of the four forms"
        ),
        Verdict.INCONSISTENT,
        otherwise_note="the four forms describe the errors of one reading; a pair of readings can also be rotated, "
        "as by the misalignments about the roll axis in ch. IV",
    )


def without_form() -> list[str]:
    """List misalignments whose effect on the gyro's readings is not a bias, a drift, a pointing or a scale factor."""
    theta = np.array([0.0, 3e-5, 2e-5])
    phase = np.linspace(0, 6, 7)
    forms = ("phi2", "phi3", "bias_y", "bias_z", "scale")

    def columns(*names: str) -> np.ndarray:
        # the drift changes from phase to phase, so it cannot compensate a constant rotation
        nominal = theta * np.linspace(1, 2, 7)[:, None]
        matrix = measurement_matrix(phase, names, nominal_theta=nominal).reshape(-1, len(names))
        return np.asarray(matrix / np.linalg.norm(matrix, axis=0))

    rank = np.linalg.matrix_rank(columns(*forms))
    angles = [name for name in STATES if name.startswith(("beta", "gamma"))]
    return [name for name in angles if np.linalg.matrix_rank(columns(*forms, name)) > rank]


@CHECKS.add("hung1982.II.deterministic-compensated")
def deterministic(printed: Statement) -> Finding:
    known, nearly = (compensated(part) for part in (1.0, 0.99))
    right = known < 1e-6 * MAS
    return compare(
        printed.claims("this type", {"can be compensated": right, "cannot be compensated": not right}),
        "after correction for a misalignment of 20 arcseconds the readings are off by "
        f"{known / MAS:.3f} milliarcseconds if the angle is known exactly, and by {nearly / MAS:.0f} "
        "if it is known to 1 %",
        note="compensation removes an error only as far as the error is known",
    )


def compensated(part: float) -> float:
    """Return the error of the spin axis after rotating back by part of a misalignment of 20 arcseconds; radians."""
    theta, gamma = np.array([0.0, 9.0, 4.0]) * ARCSEC, np.array([0.0, 20.0, 0.0]) * ARCSEC
    read = spin_in_readout(theta, np.zeros(3), gamma, 0.3)
    back = deroll(apply(rotation(-part * gamma), read)[1:], 0.3)
    return float(np.abs(back - rotation(theta)[1:, 0]).max())


@CHECKS.add("hung1982.II.random-variable-reduction", "hung1982.II.bias-reduction")
def random_variables(printed: Statement) -> Finding:
    rolls, orbits = theory.cycles_factor(52560), theory.cycles_factor(52560.3)
    stays = derivation.averages().steps[1].holds
    right = rolls == 0 and orbits < 1e-4 and stays
    right = right and math.isclose(rolled_mean(), theory.cycles_factor(10.3), rel_tol=1e-5)
    return compare(
        printed.claims("averaging", {"removes some of them": right, "removes none of them": not right}),
        f"of a constant that rolls with the spacecraft, a fraction {rolls:g} remains after 52560 "
        f"whole rolls, and {orbits:.1g} if the last roll is incomplete; a constant that does not roll "
        "remains",
        note=f"see the {CHAPTER}",
    )


@cache
def rolled_mean() -> float:
    """Return the simulated mean of a constant that rotates 10.3 times."""
    return float(experiment.turning_mean(10.3))


@cache
def averaged_process() -> tuple[float, float, float]:
    """Return the part of a process left in means over 30 correlation times (expected, simulated) and over 0.1."""
    rng = np.random.default_rng(1982)
    means = experiment.correlated_means(_RATIO, 1.0, _TRIALS, rng)
    left = float(np.sqrt(np.mean(means**2)))
    return theory.correlated_factor(_RATIO, 1.0), left, theory.correlated_factor(0.1, 1.0)


_TRIALS, _RATIO = 4000, 30.0


@CHECKS.add("hung1982.II.random-process-reduction")
def random_processes(printed: Statement) -> Finding:
    expected, left, slow = averaged_process()
    # four standard errors of a standard deviation; the rule of 400 points is 2.4e-4 off
    agree = abs(left / expected - 1) < 4 / math.sqrt(2 * _TRIALS) + 2.4e-4
    right = agree and expected < 0.5 and derivation.averages().holds
    return compare(
        printed.claims("averaging or filtering", {"reduces some of their effect": right, "reduces nothing": not right}),
        (
            f"a mean over 30 correlation times leaves {expected:.2g} of the error; a mean over a tenth of "
            f"a correlation time leaves {slow:.2g}"
        ),
        note=(
            "averaging reduces only some of the errors: it does not reduce an error that hardly changes "
            "during the averaging time"
        ),
    )


@CHECKS.add("hung1982.II.scale-factor-identification")
def scale_factor(printed: Statement) -> Finding:
    right = identifiable(20 * ARCSEC) and not identifiable(0.0)
    return compare(
        printed.claims("Kalman filtering", {"may identify it": right, "cannot identify it": not right}),
        "the readings separate the scale factor from drift and bias only if they contain a known "
        "signal that changes with time",
        note="the report does not name such a signal; the apparent motion of the guide star, which the "
        "telescope follows, is an example",
    )


def identifiable(amplitude: float) -> bool:
    """Whether a year of readings with a known signal of this size determines scale factor, drift, rate and biases."""
    time = np.arange(200) / 200
    theta = np.zeros((200, 3))
    theta[:, 1] = amplitude * np.sin(2 * np.pi * time)
    names = ("phi2", "phi3", "bias_y", "bias_z", "scale")
    H = measurement_matrix(2 * np.pi * 31.3 * time, names, nominal_theta=theta)
    rates = H[..., :2] * time[:, None, None]
    full = np.concatenate([H, rates], axis=-1).reshape(-1, 7)
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


@CHECKS.add("hung1982.II.noise-filtering")
def noise(printed: Statement) -> Finding:
    left, expected, trials = filtered_noise()
    right = abs(left / expected - 1) < 4 / math.sqrt(2 * trials) and expected < 0.5  # four standard errors
    return compare(
        printed.claims("Kalman filtering", {"may help": right, "does not help": not right}),
        f"a simulated filter for a constant leaves {left:.3g} of the noise after 400 readings; theory: {expected:.3g}",
        note="the filter reduces noise less if the noise is correlated over long times",
    )


# -- hung1982, ch. II: Table II-1 and Figure II-2 --------------------------------------------------


def total_error() -> float:
    """Return the printed total of Table II-1, in milliarcseconds."""
    return float(statement("hung1982.II.rss-total").number("total").value)


def equal_case() -> tuple[int, float]:
    """Return the printed number of equal sources, and the error of each in milliarcseconds."""
    printed = statement("hung1982.II.44-sources")
    return int(printed.number("sources").value), float(printed.number("each").value)


@CHECKS.add("hung1982.II.table-ii-1")
def table(printed: Statement) -> Finding:
    total, (sources, _) = total_error(), equal_case()
    return unverifiable(
        f"no entry can exceed {total}; if there were {sources} entries, the sum of their absolute "
        f"values would lie between {total} and {math.sqrt(sources) * total:.2f} milliarcseconds",
        "the scan has lost the table",
    )


@CHECKS.add("hung1982.II.table-abbreviations")
def abbreviations(printed: Statement) -> Finding:
    explained = set(printed.says("the classes").split(", "))
    classes = {kind.value.replace("constant", "variable") for kind in Kind} | {form.value for form in ErrorForm}
    stray = sorted(explained - classes)
    return given(
        "explains the abbreviations of Table II-1; 1/f noise, which is a random process, has a class of its own there, "
        f"because reducing it takes other means: not in the lists of the text: {', '.join(stray)}"
    )


@CHECKS.add("hung1982.II.rss-total")
def total(printed: Statement) -> Finding:
    value, (sources, single) = float(printed.number("total").value), equal_case()
    if value < 0:
        return compare(False, "the root of a sum of squares is not negative")
    return unverifiable(
        f"the total is {value / theory.GOAL - 1:.1%} above the goal; {sources} equal sources of "
        f"{theory.equal_error(value, sources):.3f} give this total, as do "
        f"{theory.equal_sources(value, single):.0f} sources of {single}",
        "the individual errors are lost with Table II-1; its blank entries could only raise the total",
    )


@CHECKS.add("hung1982.II.table-ii-1-blanks")
def blanks(printed: Statement) -> Finding:
    added = [theory.root_sum_square((total_error(), more)) for more in (0.1, 0.5, 1.0)]
    return Finding(
        "a blank entry of 0.1, 0.5 or 1 milliarcsecond would raise the total to "
        + ", ".join(f"{value:.3f}" for value in added),
        None,
        Verdict.OPEN,
        "the sources and their data are not in the documents",
    )


@CHECKS.add("hung1982.II.rss-reduction")
def reduction(printed: Statement) -> Finding:
    square = 1 - (theory.GOAL / total_error()) ** 2
    single = math.sqrt(total_error() ** 2 - theory.GOAL**2)
    return Finding(
        f"the sum of squares must fall by {square:.1%} to reach the goal; removing one source is "
        f"enough only if it contributes {single:.3f} milliarcseconds or more",
        None,
        Verdict.OPEN,
        "the documents do not say which source can be reduced",
    )


@CHECKS.add("hung1982.II.figure-ii-2")
def curve(printed: Statement) -> Finding:
    sources, _ = equal_case()
    return unverifiable(
        f"according to the text, the curve is $1/\\sqrt N$ milliarcsecond; for {sources} sources this "
        f"is {theory.equal_error(theory.GOAL, sources):.4f}",
        "the scan has lost the picture",
    )


@CHECKS.add("hung1982.II.44-sources")
def equal_sources(printed: Statement) -> Finding:
    sources, each = printed.number("sources").value, printed.number("each")
    basis = statement("hung1982.II.rss-basis").number("total").value
    largest = theory.equal_error(float(basis), float(sources)) if sources > 0 else 0.0
    value = float(each.value)
    return compare(
        prints_as(Fraction(largest), each.literal) and largest >= value and derivation.equal_sources().holds,
        f"$1/\\sqrt{{44}}={largest:.4f}$; the root sum square of 44 errors of {value} is "
        f"{theory.root_sum_square([value] * int(sources)):.4f}",
        note=f"{int(sources)} errors with the same sign would add up to {int(sources) * value:.1f}",
    )
