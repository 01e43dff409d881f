"""The digits of each block, checked by runs of their own."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gpbnb import BlockFormats, FloatFormat, Form, LinearModel, required_precision
from gpbnb.filters.blocks import BLOCKS
from gpbnb.filters.run import Run, reference_states
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.wordlength.__main__ import main

CART = LinearModel(
    [[1, "0.1"], [0, 1]], [[1, 0]], [["1e-6", "1e-5"], ["1e-5", "1e-3"]], [["1e-4"]], [0, 0], [[100, 0], [0, 100]]
)
STEPS, TOLERANCE = 60, 0.01
Z = simulated_measurements(CART, STEPS, 4)


def share(blocks, form=Form.INNOVATION):
    """Largest error of a state in any step over the tolerance."""
    run = Run(CART, blocks, form, ())
    states = run.states(Z)
    if run.stopped or run.indefinite or len(states) < STEPS:
        return np.inf
    return float(np.abs((states - reference_states(CART, Z)).sum(axis=2)).max() / TOLERANCE)


@pytest.mark.parametrize("form", [Form.INNOVATION, Form.JOSEPH, Form.UD])
def test_each_block_is_as_low_as_it_can_be_and_the_neediest_limits(form):
    found = required_precision(CART, Z, TOLERANCE, kind="blocks", form=form)
    assert share(found.format, form) == pytest.approx(found.ratio)
    assert found.ratio <= 1
    wide = BlockFormats.uniform(FloatFormat(2, 53))
    for name in BLOCKS:
        digits = found.alone[name]
        assert share(wide.with_block(name, FloatFormat(2, digits)), form) <= 1
        assert share(wide.with_block(name, FloatFormat(2, digits + 1)), form) <= 1
        assert (
            digits == 2
            or share(wide.with_block(name, FloatFormat(2, digits - 1)), form) > 1
            or share(wide.with_block(name, FloatFormat(2, digits)), form) > 1
        )
        assert getattr(found.format, name).precision <= required_precision(CART, Z, TOLERANCE, form=form).digits
    assert all(found.alone[name] == max(found.alone.values()) for name in found.limiting)
    assert found.limiting
    assert "limit" in str(found)
    # the block that is lowered last cannot be lowered any further
    last = max(BLOCKS, key=lambda name: (found.alone[name], BLOCKS.index(name)))
    lower = found.format.with_block(last, FloatFormat(2, getattr(found.format, last).precision - 1))
    assert share(lower, form) > 1


def test_without_an_answer_in_one_format_there_is_none_for_the_blocks():
    found = required_precision(CART, Z, 1e-30, kind="blocks")
    assert found.format is None
    assert str(found).startswith("no precision up to 53 bits")


def test_the_command_lists_the_blocks(tmp_path, capsys):
    model = tmp_path / "cart.toml"
    model.write_text(
        "Phi = [[1, 0.1], [0, 1]]\nH = [[1, 0]]\nQ = [[1e-6, 1e-5], [1e-5, 1e-3]]\nR = [[1e-4]]\nx0 = [0, 0]\n"
        "P0 = [[100, 0], [0, 100]]\n"
    )
    page = tmp_path / "report.html"
    asked = [
        str(model),
        "--tolerance",
        "0.01",
        "--steps",
        "60",
        "--basis",
        "emulation",
        "--mixed",
        "--report",
        str(page),
    ]
    assert main(asked) == 0
    expected = required_precision(CART, 60, 0.01, kind="blocks")
    assert str(expected) in capsys.readouterr().out
    written = json.loads(page.with_suffix(".json").read_text())
    assert written["blocks"] == [
        [name, getattr(expected.format, name).precision, expected.alone[name]] for name in BLOCKS
    ]
    assert "Precision of each block" in page.read_text()
    system = tmp_path / "system.toml"
    system.write_text("A = [[0.5]]\nB = [[1]]\n")
    assert main([str(system), "--tolerance", "0.01", "--simulate", "step", "--mixed"]) == 2
    assert "got --mixed for a linear system" in capsys.readouterr().err
    assert main([str(model), "--tolerance", "0.01", "--digits", "24", "--mixed"]) == 2
    assert "got --mixed and one format" in capsys.readouterr().err
