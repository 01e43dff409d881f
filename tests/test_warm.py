"""gpbnb.warm: every kind of run that the command needs is compiled, and shown while it is."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import warm
from gpbnb.wordlength.judging import Judgement


def test_each_kind_is_shown_with_its_number_before_it_is_compiled(capsys, monkeypatch):
    ran = []

    def kind(name):
        return name, lambda: ran.append((name, capsys.readouterr().out.splitlines()[-1]))

    monkeypatch.setattr(warm, "kinds", lambda bases: [kind(f"base {base}") for base in bases])
    assert warm.main(["--base", "2", "--base", "16"]) == 0
    assert ran == [("base 2", "1 of 2, after 0 s: base 2"), ("base 16", "2 of 2, after 0 s: base 16")]
    assert capsys.readouterr().out == "all 2 kinds of runs are compiled, after 0 s\n"
    assert warm.main([]) == 0
    assert [name for name, _ in ran[2:]] == ["base 2", "base 10", "base 16"]


def test_there_is_a_kind_for_each_base_range_rounding_form_and_basis():
    names = [name for name, _ in warm.kinds(warm.BASES)]
    assert len(set(names)) == len(names)
    for base in (2, 10, 16):
        for rounding in ("nearest", "chop", "even", "even, limited range"):
            for run in ("linear system", "innovation, emulation", "innovation, bound", "UD, emulation", "UD, bound"):
                assert f"base {base}, {rounding}: {run}" in names
            assert f"base {base}, {rounding}: guarantee" in names
    assert "fixed point: Kalman filter" in names
    assert len([name for name, _ in warm.kinds([10])]) == len(names) - 2 * 4 * 6


@pytest.mark.parametrize("name", ["base 2, nearest: linear system", "base 2, nearest: innovation, emulation"])
def test_a_kind_is_a_run_that_ends_with_an_answer(name):
    found = dict(warm.kinds([2]))[name]()
    assert isinstance(found, Judgement)
    assert np.isfinite(found.ratio)
