"""A check for each ledger entry of hung1982, ch. II, of what ch. I says of goal and period, and of hung1984, ch. I."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass
from datetime import date
from fractions import Fraction
from functools import reduce
from operator import mul

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.linalg import dot
from gpbnb.budget import derivation, experiment, theory
from gpbnb.budget.theory import ErrorForm, Kind
from gpbnb.ledger.checks import rolling
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Checks
from gpbnb.ledger.statements import load_statements, quote
from gpbnb.measurement import ARCSEC, MAS, STATES, apply, deroll, measurement_matrix, rotation, spin_in_readout

CHECKS = Checks()

CHAPTER = "chapter *Error budget*"
PRINTED_TOTAL = 1.253
PRINTED_SOURCES = 44
PRINTED_EACH = 0.15
TITLE_PAGE = "NAS8-34426"
"""The contract, on the title page of hung1984 and in hung1982, ch. I."""


# -- hung1984, ch. I ------------------------------------------------------------------------------


@CHECKS.add("hung1984.I.contents")
def contents() -> Finding:
    entries = [entry for entry in load_statements() if entry.document == "hung1984"]
    return unverifiable(
        f"the chapters are {', '.join(dict.fromkeys(entry.chapter for entry in entries))}",
        "the scan has no page numbers and no distribution list",
    )


@CHECKS.add("hung1984.I.two-tasks")
def two_tasks() -> Finding:
    mended, spoiled, kept = revised_sum(), revised_product(), revised_chain()
    return compare(
        mended and not spoiled and not kept,
        f"(18) of 1982, exceeded by the two-digit sum 5.6 + 5.9 − 11, is {'mended' if mended else 'not mended'}; (20), "
        f"right in 1982, is {'spoiled' if spoiled else 'kept'}; (31), wrong in 1982, is {'kept' if kept else 'mended'}",
        otherwise_note="not all: (31) carries over to the main result; see the chapter *Rounding bounds*",
    )


def revised_sum() -> bool:
    """Whether a sum that exceeds (18) of 1982 obeys (18) of 1984."""
    fmt = FloatFormat(10, 2)
    x = fmt.array(["5.6", "5.9", "-11"])
    beta, terms = fmt.unit_roundoff, x.to_fractions()
    true = sum(terms)
    error = abs(((x[0] + x[1]) + x[2]).to_fractions() - true)
    of_1982 = 2 * beta * abs(true)
    of_1984 = beta * (2 * abs(true) + abs(terms[2]))
    return bool(of_1982 < error <= of_1984)


def revised_product() -> bool:
    """Whether (20) of 1984, n + m + 1, differs from the count of roundings of a product of n over m, unlike 1982."""
    n, m = 3, 2
    count = (reduce(mul, [Roundings()] * n) / reduce(mul, [Roundings()] * m)).count
    return count == n + m - 1 and count != n + m + 1


@dataclass(frozen=True)
class Roundings:
    """A factor that stands for all numbers: it counts the products and quotients that led to it."""

    count: int = 0

    def __mul__(self, other: Roundings) -> Roundings:
        return Roundings(self.count + other.count + 1)

    __truediv__ = __mul__


def revised_chain() -> bool:
    """Whether (31), the same in both reports, is exceeded: a product of a row and a column of two that cancels."""
    fmt = FloatFormat(10, 4)
    row, column = fmt.array(["1.001", "-1.002"]), fmt.array(["1.001", "1"])
    true = sum(row.to_fractions() * column.to_fractions())
    error = abs(dot(row, column).to_fractions() - true)
    return bool(error > 2 * fmt.unit_roundoff * abs(true))


@CHECKS.add("hung1984.I.1-f-study")
def one_over_f_study() -> Finding:
    entries = [entry for entry in load_statements() if entry.id.startswith("hung1984.III.")]
    left = [entry for entry in entries if entry.kind == "open"]
    count = sum(rolling.CHECKS.run(entry).verdict is Verdict.ANSWERED for entry in left)
    return answer(
        bool(left) and count == len(left),
        f"of the {len(left)} studies that ch. III leaves open, {count} are answered here",
        "the ledger of hung1984, ch. III",
    )


@CHECKS.add("hung1984.I.report-period")
def period_1984() -> Finding:
    months, days = span(date(1982, 9, 1), date(1983, 12, 1))
    return compare((months, days) == (15, 0), f"{months} months and {days} days, the last day included")


@CHECKS.add("hung1984.I.contract")
def contract() -> Finding:
    return compare(
        TITLE_PAGE in quote("hung1984.I.contract"),
        TITLE_PAGE,
        Verdict.MISPRINT,
        otherwise_note="the title page and hung1982 have an S, where this page, or its scan, has a 5",
    )


# -- hung1982, ch. I ------------------------------------------------------------------------------


@CHECKS.add("hung1982.I.drift-rate")
def drift_rate() -> Finding:
    others = math.sqrt(theory.GOAL**2 - (0.001 * ARCSEC / MAS) ** 2)
    return unverifiable(
        f"at this limit the gyro alone takes up the goal: {others:g} milliarcseconds are left for all other sources",
        "no data on gyro drift in the documents",
    )


@CHECKS.add("hung1982.I.design-goal", "hung1982.II.rss-basis")
def design_goal() -> Finding:
    goal = 0.001 * ARCSEC / MAS
    return compare(
        math.isclose(goal, theory.GOAL, rel_tol=1e-12),
        f"$.001$ arcsecond is {goal:g} milliarcsecond, the basis of Figure II-2",
        Verdict.INCONSISTENT,
        note="the goal of ch. I and the basis of ch. II are one number; the scan of ch. I lost the decimal point",
    )


@CHECKS.add("hung1982.I.history", "hung1982.I.apparatus")
def history() -> Finding:
    return unverifiable("", "told without a source, and nothing in the analysis rests on it")


@CHECKS.add("hung1982.I.previous-contract")
def previous_contract() -> Finding:
    told, listed = (quote(f"hung1982.{key}") for key in ("I.previous-contract", "II.references"))
    numbers = [re.findall(r"NAS8-\d+", each) for each in (told, listed)]
    award, end, start = date(1980, 4, 1), date(1981, 2, 18), date(1981, 6, 24)
    dates = "April 1980" in told and "18 February 1981" in listed
    months, _ = span(award, end)
    return compare(
        dates and numbers[0] == numbers[1] and award < end < start,
        f"its final report, the first reference of ch. II, has the same number, {' and '.join(numbers[1])}; it came "
        f"{months} months later, and {span(end, start)[0]} months before this contract's period",
    )


@CHECKS.add("hung1982.I.contract")
def contract_1982() -> Finding:
    return compare(
        TITLE_PAGE in quote("hung1982.I.contract"),
        f"{TITLE_PAGE}, as on the title page of hung1984",
        Verdict.INCONSISTENT,
    )


@CHECKS.add("hung1982.I.chapters-ii-and-iii")
def chapters() -> Finding:
    where = {entry.item: entry.chapter for entry in load_statements() if entry.document == "hung1982"}
    found = [where["classification by statistics"], where["main result"]]
    return compare(
        re.findall("Chapter ([IVX]+)", quote("hung1982.I.chapters-ii-and-iii")) == found,
        f"they are chapters {' and '.join(found)}",
        Verdict.INCONSISTENT,
    )


@CHECKS.add("hung1982.I.references", "hung1982.II.references")
def references() -> Finding:
    return unverifiable("", "the works are not among the documents; all but the first of ch. II are lost from the scan")


@CHECKS.add("hung1982.I.chapter-reference")
def chapter_reference() -> Finding:
    entries = [entry for entry in load_statements() if entry.document == "hung1982"]
    (where,) = {entry.chapter for entry in entries if entry.item == "six frames"}
    return compare(
        quote("hung1982.I.chapter-reference").endswith(f"Chapter {where}"),
        f"the measurement geometry is chapter {where}",
        Verdict.MISPRINT,
        otherwise_note="two letters changed places; there is no chapter VI",
    )


@CHECKS.add("hung1982.I.report-period")
def period_1982() -> Finding:
    end = date(1982, 8, 31)
    printed, mended = span(date(1987, 6, 24), end), span(date(1981, 6, 24), end)
    return compare(
        printed[0] == 14,
        f"from 1987 {printed[0]} months; from 1981 {mended[0]} months and {mended[1]} days",
        Verdict.OCR,
        otherwise_note="1981, read as 1987",
    )


def span(start: date, end: date) -> tuple[int, int]:
    """Whole months and the days beyond them, from `start` to `end`."""
    months = 12 * (end.year - start.year) + end.month - start.month - (end.day < start.day)
    later = start.year * 12 + start.month - 1 + months
    return months, (end - date(later // 12, later % 12 + 1, start.day)).days


# -- hung1982, ch. II: figures and classes --------------------------------------------------------


@CHECKS.add("hung1982.II.figure-ii-1", "hung1982.II.nine-groups")
def block_diagram() -> Finding:
    return unverifiable("", "the picture is lost from the scan, and the text does not name the nine groups")


@CHECKS.add("hung1982.II.classification-by-statistics")
def by_statistics() -> Finding:
    def classes(known: bool, constant: bool) -> list[Kind]:
        holds = {
            Kind.DETERMINISTIC: known,
            Kind.CONSTANT: not known and constant,
            Kind.PROCESS: not known and not constant,
        }
        return [kind for kind in Kind if holds[kind]]

    counts = [len(classes(*case)) for case in itertools.product((True, False), repeat=2)]
    return compare(
        counts == [1] * 4,
        "every error, known or not, constant or not, is in exactly one class",
        note="1/f noise, which Table II-1 lists apart, is a random process",
    )


@CHECKS.add("hung1982.II.classification-by-form")
def by_form() -> Finding:
    outside = without_form()
    return compare(
        not outside,
        f"of the columns of the measurement matrix, those of {', '.join(outside)} are sums of none of the others",
        Verdict.INCONSISTENT,
        otherwise_note="bias, drift, scale factor and noise are the forms of one reading; two readings also have a "
        "turn between them, and the misalignments about the roll axis of ch. IV are of this form",
    )


def without_form() -> list[str]:
    """Misalignments whose effect on the gyro's readings is neither bias, nor drift or pointing, nor scale factor."""
    theta = np.array([0.0, 3e-5, 2e-5])
    phase = np.linspace(0, 6, 7)
    forms = ("phi2", "phi3", "bias_y", "bias_z", "scale")

    def columns(*names: str) -> np.ndarray:
        # the drift changes from phase to phase, so that it cannot make up for a turn that stands still
        nominal = theta * np.linspace(1, 2, 7)[:, None]
        matrix = measurement_matrix(phase, names, nominal_theta=nominal).reshape(-1, len(names))
        return np.asarray(matrix / np.linalg.norm(matrix, axis=0))

    rank = np.linalg.matrix_rank(columns(*forms))
    angles = [name for name in STATES if name.startswith(("beta", "gamma"))]
    return [name for name in angles if np.linalg.matrix_rank(columns(*forms, name)) > rank]


@CHECKS.add("hung1982.II.deterministic-compensated")
def deterministic() -> Finding:
    known, nearly = (compensated(part) for part in (1.0, 0.99))
    return compare(
        known < 1e-6 * MAS,
        f"readings turned back through a known misalignment of 20 arcseconds are off by {known / MAS:.3f} "
        f"milliarcseconds; through one that is known to 1 %, by {nearly / MAS:.0f}",
        note="as far as they are known",
    )


def compensated(part: float) -> float:
    """Error of the spin axis after turning back through a part of a misalignment of 20 arcseconds; radians."""
    theta, gamma = np.array([0.0, 9.0, 4.0]) * ARCSEC, np.array([0.0, 20.0, 0.0]) * ARCSEC
    read = spin_in_readout(theta, np.zeros(3), gamma, 0.3)
    back = deroll(apply(rotation(-part * gamma), read)[1:], 0.3)
    return float(np.abs(back - rotation(theta)[1:, 0]).max())


@CHECKS.add("hung1982.II.random-variable-reduction", "hung1982.II.bias-reduction")
def random_variables() -> Finding:
    rolls, orbits = theory.cycles_factor(52560), theory.cycles_factor(52560.3)
    stays = derivation.averages().steps[1].holds
    measured = experiment.turning_mean(10.3)
    return compare(
        rolls == 0 and orbits < 1e-4 and stays and math.isclose(measured, theory.cycles_factor(10.3), rel_tol=1e-5),
        f"a constant that rolls: {rolls:g} of it is left after 52560 whole rolls, {orbits:.1g} if the last is not "
        "whole; a constant that does not roll stays",
        note=CHAPTER,
    )


@CHECKS.add("hung1982.II.random-process-reduction")
def random_processes() -> Finding:
    rng = np.random.default_rng(1982)
    trials, ratio = 4000, 30.0
    means = experiment.correlated_means(ratio, 1.0, trials, rng)
    left, expected = float(np.sqrt(np.mean(means**2))), theory.correlated_factor(ratio, 1.0)
    # the standard error of a standard deviation, four of them; the rule of 400 points is 2.4e-4 off
    agree = abs(left / expected - 1) < 4 / math.sqrt(2 * trials) + 2.4e-4
    slow = theory.correlated_factor(0.1, 1.0)
    return compare(
        agree and expected < 0.5 and derivation.averages().holds,
        f"a mean over 30 correlation times leaves {expected:.2g}, one over a tenth of one {slow:.2g}",
        note="some: averaging does not help against what hardly changes within the mean",
    )


@CHECKS.add("hung1982.II.scale-factor-identification")
def scale_factor() -> Finding:
    with_signal, without = (identifiable(signal) for signal in (20 * ARCSEC, 0.0))
    return compare(
        with_signal and not without,
        "with a known signal that changes in time, readings tell scale factor from drift and bias; without one they "
        "do not",
        note="the report does not name the signal; the apparent motion of the star, which the telescope follows, is "
        "one",
    )


def identifiable(amplitude: float) -> bool:
    """Whether readings of a year determine scale factor, drift, its rate and biases; a known signal of this size."""
    time = np.arange(200) / 200
    theta = np.zeros((200, 3))
    theta[:, 1] = amplitude * np.sin(2 * np.pi * time)
    names = ("phi2", "phi3", "bias_y", "bias_z", "scale")
    H = measurement_matrix(2 * np.pi * 31.3 * time, names, nominal_theta=theta)
    rates = H[..., :2] * time[:, None, None]
    full = np.concatenate([H, rates], axis=-1).reshape(-1, 7)
    size = np.linalg.norm(full, axis=0)
    return bool(np.linalg.matrix_rank(full / np.where(size, size, 1)) == 7)


@CHECKS.add("hung1982.II.noise-filtering")
def noise() -> Finding:
    left, whole = theory.white_factor(3153600), Fraction(1, 3153600)
    return compare(
        math.isclose(left**2, float(whole), rel_tol=1e-12) and derivation.averages().steps[2].holds,
        f"the mean of 3153600 independent readings leaves {left:.2g} of their noise",
        note="a filter for constants is a mean; noise that is correlated over long times gains less",
    )


# -- hung1982, ch. II: Table II-1 and Figure II-2 --------------------------------------------------


@CHECKS.add("hung1982.II.table-ii-1")
def table() -> Finding:
    largest = math.sqrt(PRINTED_SOURCES) * PRINTED_TOTAL
    return unverifiable(
        f"no entry is above {PRINTED_TOTAL}; were there {PRINTED_SOURCES}, the sum of their sizes is from "
        f"{PRINTED_TOTAL} to {largest:.2f} milliarcseconds",
        "the table is lost from the scan",
    )


@CHECKS.add("hung1982.II.table-abbreviations")
def abbreviations() -> Finding:
    explained = {"random variable", "random process", "1/f noise", "deterministic"}
    classes = {kind.value.replace("constant", "variable") for kind in Kind} | {form.value for form in ErrorForm}
    stray = sorted(explained - classes)
    return compare(
        not stray,
        f"{', '.join(stray) or 'none'} is no class of either list",
        Verdict.INCONSISTENT,
        otherwise_note="a random process, to be reduced otherwise than white noise: hung1984, ch. III, is about it",
    )


@CHECKS.add("hung1982.II.rss-total")
def total() -> Finding:
    each = theory.equal_error(PRINTED_TOTAL, PRINTED_SOURCES)
    return unverifiable(
        f"{PRINTED_TOTAL / theory.GOAL - 1:.1%} above the goal; {PRINTED_SOURCES} equal sources of {each:.3f} "
        f"make it up, or {theory.equal_sources(PRINTED_TOTAL, PRINTED_EACH):.0f} of {PRINTED_EACH}",
        "the errors that were added up are lost with Table II-1; its blanks can only raise the total",
    )


@CHECKS.add("hung1982.II.table-ii-1-blanks")
def blanks() -> Finding:
    added = [theory.root_sum_square((PRINTED_TOTAL, more)) for more in (0.1, 0.5, 1.0)]
    return Finding(
        "a blank of 0.1, 0.5 or 1 milliarcsecond makes the total " + ", ".join(f"{value:.3f}" for value in added),
        None,
        Verdict.OPEN,
        "the sources and their data are not in the documents",
    )


@CHECKS.add("hung1982.II.rss-reduction")
def reduction() -> Finding:
    square = 1 - (theory.GOAL / PRINTED_TOTAL) ** 2
    single = math.sqrt(PRINTED_TOTAL**2 - theory.GOAL**2)
    return Finding(
        f"to reach the goal the sum of squares must fall by {square:.1%}; taking away one source does it only if that "
        f"is {single:.3f} milliarcseconds or more",
        None,
        Verdict.OPEN,
        "which source can be reduced is not in the documents",
    )


@CHECKS.add("hung1982.II.figure-ii-2", "hung1982.II.44-sources")
def curve() -> Finding:
    each = theory.equal_error(theory.GOAL, PRINTED_SOURCES)
    one_sign = PRINTED_SOURCES * PRINTED_EACH
    return compare(
        round(each, 2) == PRINTED_EACH and each >= PRINTED_EACH and derivation.equal_sources().holds,
        f"$1/\\sqrt{{44}}={each:.4f}$; 44 errors of {PRINTED_EACH} make "
        f"{theory.root_sum_square([PRINTED_EACH] * PRINTED_SOURCES):.4f}",
        note=f"the picture is lost, its curve is $1/\\sqrt N$; errors of one sign would add up to {one_sign:.1f}",
    )
