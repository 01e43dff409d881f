"""Count outputs of generated C that change with flags that C99 rules out: ``python -m benchmarks.code_flags``.

Fused operations and other orders of sums change outputs; ``benchmarks/results`` has the counts.
"""

from __future__ import annotations

import datetime
import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gpbnb import BINARY32, write_code
from gpbnb.bounds.system import output_errors
from gpbnb.filters.design import FilterDesign
from gpbnb.report.display.tables import Table
from gpbnb.wordlength.c_files import FLAGS

STEPS = 10_000
RESULTS = Path(__file__).parent / "results"


def installed() -> list[str]:
    """The compilers that are installed."""
    return [each for each in ("gcc", "clang") if shutil.which(each)]


def _two_low_pass_sections() -> tuple[Any, Any]:
    """Return b and a of a low-pass section at 440 Hz twice in a row."""
    angle = 2 * math.pi * 440 / 44100
    alpha = math.sin(angle) / 2
    section_b = np.array([1 - math.cos(angle), 2 - 2 * math.cos(angle), 1 - math.cos(angle)]) / (2 + 2 * alpha)
    section_a = np.array([1 + alpha, -2 * math.cos(angle), 1 - alpha]) / (1 + alpha)
    return np.convolve(section_b, section_b), np.convolve(section_a, section_a)


class Change(NamedTuple):
    """How a build with other flags differs from the emulation.

    Parameters
    ----------
    label, compiler, flags : filter, and how it was built.
    steps, different : outputs compared, and those that differ.
    largest : largest difference over the guarantee of the filter.
    """

    label: str
    compiler: str
    flags: str
    steps: int
    different: int
    largest: float


BUILDS = (
    FLAGS.split()[-1],
    "-ffp-contract=fast -march=x86-64-v3",
    "-ffast-math -march=x86-64",
    "-ffast-math -march=x86-64-v3",
)
"""As the header asks; with fused operations; with other orders of sums; with both."""

MAIN = """#include <stdio.h>
#include "filter.h"

int main(void)
{
    filter_state state;
    filter_number input[1], output[1];
    filter_start(&state);
    while (scanf("%f", input) == 1) {
        filter_step(&state, input, output);
        printf("%a\\n", output[0]);
    }
    return 0;
}
"""


def changes(steps: int = STEPS) -> Iterator[Change]:
    """Build the low-pass filters in binary32 with other flags, and compare their outputs with the emulation."""
    b, a = _two_low_pass_sections()
    u = np.random.default_rng(0).uniform(-1, 1, (steps, 1)).astype(np.float32)
    for structure in ("direct form I", "direct form II transposed", "cascade of direct form II transposed", "lattice"):
        design = FilterDesign(b, a, name="two low-pass sections")
        system = design.system(structure)
        (bound,) = output_errors(system, BINARY32, np.array([1.0]))
        expected = system.outputs(u, BINARY32)[:, 0, 0]
        for compiler, flags in product(installed(), BUILDS):
            with tempfile.TemporaryDirectory() as folder:
                write_code(design, BINARY32, folder, form=structure)
                (Path(folder) / "main.c").write_text(MAIN)
                command = [compiler, "-std=c99", "-O2", *flags.split(), "-DFILTER_FAST_MATH", "-o", "run"]
                subprocess.run([*command, "main.c", "filter.c"], cwd=folder, check=True)
                given = "\n".join(float(each).hex() for each in u[:, 0])
                done = subprocess.run(["./run"], cwd=folder, input=given, capture_output=True, text=True, check=True)
            found = np.array([float.fromhex(each) for each in done.stdout.split()])
            error = np.abs(found - expected)
            yield Change(structure, compiler, flags, steps, int((error > 0).sum()), float(error.max() / bound))


def write(found: Sequence[Change]) -> None:
    """Store what other flags change, a row for each structure and flag, a column for each compiler."""
    compilers = list(dict.fromkeys(each.compiler for each in found))
    cells = {(each.label, each.flags, each.compiler): each for each in found}
    body = []
    for label, flags in dict.fromkeys((each.label, each.flags) for each in found):
        mine = [cells[label, flags, compiler] for compiler in compilers]
        body.append((label, flags, *(f"{each.different:,}, {each.largest:.2g}" for each in mine)))
    table = Table("flags", ("structure", "flags", *compilers), tuple(body)).markdown()
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    about = (
        f"Number of outputs, of {found[0].steps:,}, that differ from the emulation, and the largest difference as a "
        "share of the guarantee. "
        f"Compiled on {date} with {'; '.join(map(version, compilers))}, all with `-std=c99 -O2`."
    )
    (RESULTS / "code_flags.md").write_text(f"{table}\n\n{about}\n", encoding="utf-8")


def version(compiler: str) -> str:
    """The first line of a compiler's version."""
    return subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]


if __name__ == "__main__":
    write([*changes()])
