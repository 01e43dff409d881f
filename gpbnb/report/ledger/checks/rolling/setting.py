"""Checks of what ch. III says about the experiment before it computes: carriers, pair of signals, offset zero."""

from __future__ import annotations

import numpy as np

from gpbnb.report.ledger.checks.rolling.process import low_frequency, signals
from gpbnb.report.ledger.checks.rolling.registry import CHECKS, entry
from gpbnb.report.ledger.finding import Finding, compare
from gpbnb.report.ledger.statements import Statement, load_statements
from gpbnb.report.measurement import spin_in_readout
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.theory import PERIOD

GYROS = {"each": 4, "one": 1}
TURNS, SAMPLES = 20, 1200


def rolled_spins() -> np.ndarray:
    """Return the readings (4, samples) of four gyros with different drift angles during 20 turns, as complex pairs."""
    phase = theory.roll_phase(np.arange(SAMPLES), PERIOD)
    spins = np.array([[0.0, 3.0, 1.0], [0.0, -2.0, 4.0], [0.0, 5.0, -6.0], [0.0, 1.0, 2.0]]) * 1e-5
    none = np.zeros(3)
    read = [spin_in_readout(spin, none, none, phase) for spin in spins]
    return np.array([each[:, 1] + 1j * each[:, 2] for each in read])


@CHECKS.add(entry("s1.carrier-on-each-gyro"))
def carrier_on_each(printed: Statement) -> Finding:
    transforms = np.abs(np.fft.fft(rolled_spins(), axis=1))
    peaks = np.abs(np.fft.fftfreq(SAMPLES)[np.argmax(transforms, axis=1)]) * SAMPLES
    modulated = int(np.sum(np.abs(peaks - TURNS) < 0.5))
    return compare(
        GYROS[printed.says("gyros").split(" ", 1)[0]] == modulated,
        f"the readings of {modulated} of {len(peaks)} gyros with constant, different drift angles have their spectrum "
        f"at {TURNS} cycles in {TURNS} turns",
        note="a gyro that points exactly along the roll axis shows no carrier",
    )


@CHECKS.add(entry("s1.pair-of-signals"))
def pair_of_signals(printed: Statement) -> Finding:
    h, none = 1e-6, np.zeros(3)
    columns = [
        spin_in_readout(none + step, none, none, 0.4) - spin_in_readout(none - step, none, none, 0.4)
        for step in h * np.eye(3)
    ]
    count = int(np.linalg.matrix_rank(np.array(columns) / h, tol=1e-6))
    return compare(
        {"one signal": 1, "a pair of signals": 2, "three signals": 3}[printed.says("signal")] == count,
        f"the readings of a gyro depend on {count} of the three angles of its spin axis: a turn about the spin axis "
        "itself is not seen",
    )


@CHECKS.add(entry("s2.first-three"))
def first_three(printed: Statement) -> Finding:
    place = entry("s")
    sections = sorted({each.section for each in load_statements() if each.id.startswith(place)} - {"1", "2", "6"})
    return compare(
        {"three": 3, "two": 2, "five": 5}[printed.says("sources")] == len(sections),
        f"they are the subjects of sections {', '.join(sections)}",
    )


@CHECKS.add(entry("s4.ideally-zero"))
def ideally_zero(printed: Statement) -> Finding:
    offset = {"Δω = 0": 0, "Δω = 1": 1, "Δω = −1": -1}[printed.says("offset")]
    kept = [low_frequency(names["s"](0), offset * names["t"]) - low_frequency(names["s"](0), 0) for names in signals()]
    return compare(
        all(each == 0 for each in kept),
        "by (11), the extracted signal stays what it is at the start only if the two frequencies are equal",
    )
