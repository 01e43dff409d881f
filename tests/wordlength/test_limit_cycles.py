"""Limit cycles against runs from every state by plain loops, and against closed forms."""

from __future__ import annotations

from fractions import Fraction
from itertools import cycle, product

import pytest

from gpbnb import FixedFormat, LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength import limit_cycles as module
from gpbnb.wordlength.limit_cycles import limit_cycles
from tests.oracles import fixed, limited

MODES = ["nearest", "even", "half up", "chop", "up", "down", "odd"]


def ends_of(step, states):
    """The cycles, as sets of their states, in which runs from some states end."""
    following = {state: step(state) for state in states}
    left = set(following)
    while (kept := {following[state] for state in left}) != left:
        left = kept
    found = set()
    while left:
        cycle = [left.pop()]
        while (state := following[cycle[-1]]) != cycle[0]:
            cycle.append(state)
            left.remove(state)
        found.add(frozenset(cycle))
    return found


POLES = [("-1.5", "0.75"), ("0.7", "0.85"), ("-1.2", "0.8"), ("0", "-0.9")]


@pytest.mark.parametrize(("mode", "poles"), [*zip(MODES, cycle(POLES)), ("nearest", POLES[1]), ("chop", POLES[2])])
def test_cycles_are_those_in_which_runs_from_every_state_end(mode, poles):
    """A section of second order in direct form I with one rounding for each output; words of 7 bits."""
    system = LinearSystem.from_coefficients([1], [1, *poles], "direct form I")
    words = WordFormats(FixedFormat(6, 0, mode, "saturate"), FixedFormat(2, 8), FixedFormat(12, 8))
    r, keep = fixed(0, mode), limited(0, 6, "saturate")
    c1, c2 = (fixed(8, "nearest")(Fraction(each)) for each in poles)

    def step(state):
        y = keep(r(Fraction(0) - c1 * state[0] - c2 * state[1]))
        return int(y), state[0]

    expected = ends_of(step, product(range(-64, 64), repeat=2))
    found = limit_cycles(system, words, everywhere=True)
    cycles = {frozenset(map(tuple, cycle.states[:, :2].tolist())) for cycle in found.cycles}
    assert cycles == expected
    assert found.searched == 128**2
    inner = limit_cycles(system, words)
    if found.largest <= inner.bound:  # no cycle needs an overflow
        assert {frozenset(map(tuple, cycle.states[:, :2].tolist())) for cycle in inner.cycles} == expected
        assert inner.searched < found.searched
    assert inner.largest <= inner.bound
    assert [cycle.period for cycle in found.cycles] == sorted(map(len, cycles), reverse=True)
    assert found.largest == [max(abs(y) for cycle in expected for y, _ in cycle)]


def test_a_smoother_with_floor_rests_up_to_three_units_below_its_input(monkeypatch):
    words = WordFormats(FixedFormat(15, 0, "down"), FixedFormat(3, 12))
    found = limit_cycles(LinearSystem.smoother("1097/4096"), words, 512)
    assert sorted(int(cycle.outputs[0, 0]) for cycle in found.cycles) == [509, 510, 511, 512]
    assert found.largest == [3]
    assert found.rest == [512]
    monkeypatch.setattr(module, "MOST_STATES", 3)
    few = limit_cycles(LinearSystem.smoother("1097/4096"), words, 512)
    assert (few.cycles, few.searched, few.largest) == (None, 0, found.bound)
    assert str(few) == "outputs stay within 3.73382 units of rest; too many states to try each"
