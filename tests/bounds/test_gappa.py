"""Bounds of single steps beside those of Gappa, for the same operations and inputs."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gpbnb.bounds.guarantee import FilterGuarantee
from gpbnb.report.guarantees import gappa
from gpbnb.report.guarantees.table import FORMAT, case_guarantee, case_named


def one_step(name: str) -> FilterGuarantee:
    case = case_named(name)
    return gappa.single_step(case_guarantee(case, case.make(), FORMAT))


def computed(text: str, x: list[Fraction]) -> tuple[dict[str, Fraction], dict[str, Fraction]]:
    """Run a script for Gappa on some inputs, with rounding and without."""
    rounded, exact = ({f"v{i}": each for i, each in enumerate(x)} for _ in range(2))

    def value(word: str, known: dict[str, Fraction]) -> Fraction:
        found = re.fullmatch(r"(-?\d+)b-(\d+)", word)
        return Fraction(int(found[1]), 2 ** int(found[2])) if found else known[word]

    act: dict[str, Callable[[Fraction, Fraction], Fraction]] = {
        "*": lambda a, b: a * b,
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
    }
    for name, a, sign, b in re.findall(r"(v\d+) = r\((\S+) (\S) (\S+)\);", text):
        rounded[name] = Fraction(FORMAT.round(act[sign](value(a, rounded), value(b, rounded))))
    for name, a, sign, b in re.findall(r"(e\d+) = (\S+) (\S) (\S+);", text):
        exact[name] = act[sign](value(a, exact), value(b, exact))
    return rounded, exact


def test_the_script_has_the_operations_of_the_filter() -> None:
    """The exact value of each state is that of the gain and the model, and rounding stays within both bounds."""
    found = one_step("tracker, 0 m from its origin")
    text, stored = gappa.script(found), {row.state: row for row in gappa.load() if row.name.startswith("tracker")}
    given = found.schedule
    Phi, HPhi = given.Phi[-1, :, :, 0], given.HPhi[-1, :, :, 0]
    K = given.coefficients[-1, [given.program.coefficient_names.index(f"K[{i}][0]") for i in range(2)], :1]
    rng = np.random.default_rng(41)
    outputs = given.program.outputs.tolist()
    for _ in range(50):
        x = rng.uniform(-1, 1, 2) * 0.98 * found.limits.state
        z = HPhi @ x + rng.uniform(-8, 8, 1)
        inputs = [Fraction(FORMAT.round(each)) for each in (*x, *z)]
        rounded, exact = computed(text, inputs)
        x, z = np.array(inputs[:2], dtype=float), np.array(inputs[2:], dtype=float)
        expected = Phi @ x + K @ (z - HPhi @ x)
        for i, v in enumerate(outputs):
            assert float(exact[f"e{v}"]) == pytest.approx(expected[i], rel=1e-12)
            off = abs(rounded[f"v{v}"] - exact[f"e{v}"])
            assert 0 < off <= min(float(stored[i].ours), float(stored[i].gappa))


def test_a_bound_is_the_larger_end_of_an_interval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = "v4 - e4 in [-3b-2 {-0.75}, 1b-2 {0.25}]", "v5 - e5 in [-1, 5]"
    (tmp_path / "gappa").write_text("#!/bin/sh\n" + "".join(f"echo '{line}'\n" for line in lines))
    (tmp_path / "gappa").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    assert gappa.gappa("") == [0.75, 5]


def test_without_gappa_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(FileNotFoundError, match=r"needed Gappa 1\.4"):
        gappa.gappa("")
    rows = [tuple(map(str, row)) for row in gappa.load()]
    name = gappa.FILTERS[0]
    assert gappa.SWEEP.sample is not None
    assert gappa.SWEEP.sample(name, np.random.default_rng(1)) == [row for row in rows if row[0] == name]


@pytest.mark.skipif(shutil.which("gappa") is None, reason="needs Gappa")
def test_gappa_finds_the_stored_bounds() -> None:
    name = gappa.FILTERS[1]
    found = gappa.gappa(gappa.script(one_step(name)))
    assert [f"{each:.4g}" for each in found] == [row.gappa for row in gappa.load() if row.name == name]
    with pytest.raises(RuntimeError, match="needed bounds"):
        gappa.gappa("{ x in [0, 1] -> }")
