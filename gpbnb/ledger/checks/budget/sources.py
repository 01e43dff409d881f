"""Error sources, their classes and their budget: hung1982, ch. II."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.arithmetic.formats import prints_as
from gpbnb.budget import derivation, experiment, theory
from gpbnb.budget.theory import ErrorForm, Kind
from gpbnb.ledger.checks.budget.registry import CHAPTER, CHECKS
from gpbnb.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.ledger.statements import Statement, statement
from gpbnb.measurement import ARCSEC, MAS, STATES, apply, deroll, measurement_matrix, rotation, spin_in_readout

# -- hung1982, ch. II: figures and classes --------------------------------------------------------


@CHECKS.add("hung1982.II.figure-ii-1", "hung1982.II.nine-groups")
def block_diagram(printed: Statement) -> Finding:
    return unverifiable("", "the picture is lost from the scan, and the text does not name the nine groups")


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
        "every error, known or not, constant or not, is in exactly one class",
        note="1/f noise, which Table II-1 lists apart, is a random process",
    )


@CHECKS.add("hung1982.II.classification-by-form")
def by_form(printed: Statement) -> Finding:
    outside = without_form()
    return compare(
        printed.claims("the four forms", {"cover every error": not outside, "leave errors out": bool(outside)}),
        f"the columns of the measurement matrix for {', '.join(outside)} are no sums of those of the four forms",
        Verdict.INCONSISTENT,
        otherwise_note="bias, drift, scale factor and noise are the forms of one reading; two readings also have a "
        "rotation between them, and the misalignments about the roll axis of ch. IV are of this form",
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
        f"readings turned back through a known misalignment of 20 arcseconds are off by {known / MAS:.3f} "
        f"milliarcseconds; through one that is known to 1 %, by {nearly / MAS:.0f}",
        note="as far as they are known",
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
        f"a constant that rolls: {rolls:g} of it is left after 52560 whole rolls, {orbits:.1g} if the last is not "
        "whole; a constant that does not roll stays",
        note=CHAPTER,
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
        f"a mean over 30 correlation times leaves {expected:.2g}, one over a tenth of one {slow:.2g}",
        note="some: averaging does not help against what hardly changes within the mean",
    )


@CHECKS.add("hung1982.II.scale-factor-identification")
def scale_factor(printed: Statement) -> Finding:
    right = identifiable(20 * ARCSEC) and not identifiable(0.0)
    return compare(
        printed.claims("Kalman filtering", {"may identify it": right, "cannot identify it": not right}),
        "with a known signal that changes in time, readings separate scale factor from drift and bias; without one "
        "they do not",
        note="the report does not name the signal; the apparent motion of the star, which the telescope follows, is "
        "one",
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
    """Return error of a Kalman filter for a constant in white noise / error of one reading, √(1/N), and the trials."""
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
        note="noise that is correlated over long times gains less",
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
        f"no entry is above {total}; were there {sources}, the sum of their sizes is from {total} to "
        f"{math.sqrt(sources) * total:.2f} milliarcseconds",
        "the table is lost from the scan",
    )


@CHECKS.add("hung1982.II.table-abbreviations")
def abbreviations(printed: Statement) -> Finding:
    explained = set(printed.says("the classes").split(", "))
    classes = {kind.value.replace("constant", "variable") for kind in Kind} | {form.value for form in ErrorForm}
    stray = sorted(explained - classes)
    return compare(
        not stray,
        f"{', '.join(stray) or 'none'} is no class of either list",
        Verdict.INCONSISTENT,
        otherwise_note="a random process, to be reduced otherwise than white noise: hung1984, ch. III, is about it",
    )


@CHECKS.add("hung1982.II.rss-total")
def total(printed: Statement) -> Finding:
    value, (sources, single) = float(printed.number("total").value), equal_case()
    if value < 0:
        return compare(False, "the root of a sum of squares is not negative")
    return unverifiable(
        f"{value / theory.GOAL - 1:.1%} above the goal; {sources} equal sources of "
        f"{theory.equal_error(value, sources):.3f} make it up, or {theory.equal_sources(value, single):.0f} "
        f"of {single}",
        "the errors that were added up are lost with Table II-1; its blanks can only raise the total",
    )


@CHECKS.add("hung1982.II.table-ii-1-blanks")
def blanks(printed: Statement) -> Finding:
    added = [theory.root_sum_square((total_error(), more)) for more in (0.1, 0.5, 1.0)]
    return Finding(
        "a blank of 0.1, 0.5 or 1 milliarcsecond makes the total " + ", ".join(f"{value:.3f}" for value in added),
        None,
        Verdict.OPEN,
        "the sources and their data are not in the documents",
    )


@CHECKS.add("hung1982.II.rss-reduction")
def reduction(printed: Statement) -> Finding:
    square = 1 - (theory.GOAL / total_error()) ** 2
    single = math.sqrt(total_error() ** 2 - theory.GOAL**2)
    return Finding(
        f"to reach the goal the sum of squares must fall by {square:.1%}; taking away one source does it only if that "
        f"is {single:.3f} milliarcseconds or more",
        None,
        Verdict.OPEN,
        "which source can be reduced is not in the documents",
    )


@CHECKS.add("hung1982.II.figure-ii-2")
def curve(printed: Statement) -> Finding:
    sources, _ = equal_case()
    return unverifiable(
        f"by the text its curve is $1/\\sqrt N$ milliarcsecond; for {sources} sources "
        f"{theory.equal_error(theory.GOAL, sources):.4f}",
        "the picture is lost from the scan",
    )


@CHECKS.add("hung1982.II.44-sources")
def equal_sources(printed: Statement) -> Finding:
    sources, each = printed.number("sources").value, printed.number("each")
    basis = statement("hung1982.II.rss-basis").number("total").value
    largest = theory.equal_error(float(basis), float(sources)) if sources > 0 else 0.0
    value = float(each.value)
    return compare(
        prints_as(Fraction(largest), each.literal) and largest >= value and derivation.equal_sources().holds,
        f"$1/\\sqrt{{44}}={largest:.4f}$; 44 errors of {value} make "
        f"{theory.root_sum_square([value] * int(sources)):.4f}",
        note=f"errors of one sign would add up to {int(sources) * value:.1f}",
    )
