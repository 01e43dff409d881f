"""Compare generated C code with its emulation, bit for bit: ``python -m benchmarks.code``.

Each combination of a filter, its structure or form, and a format is written as C, compiled by each compiler that is
installed, without and with optimization, and run over 10,000 steps; every state and every output of every step is
compared. A further build runs the same steps under the sanitizer of undefined behaviour. Each build also runs the test
program that comes with the code.

The whole comparison takes 40 minutes on one core. It writes each finished combination to a journal in ``.cache`` and
resumes from it, as long as the code and the compilers stay the same. When all are done, it leaves their counts in
``benchmarks/results``.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import math
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import cycle, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from benchmarks import code_batch
from benchmarks.code_batch import Case, Outcome, compare
from benchmarks.journal import Journal
from gpbnb import BINARY32, BINARY64, FixedFormat, Form, LinearModel, LinearSystem, Rounding, WordFormats, caching
from gpbnb.bounds.system import output_errors
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.forms import CONSTANT_GAIN
from gpbnb.filters.structures import STRUCTURES
from gpbnb.report.display.tables import Table
from gpbnb.wordlength import code
from gpbnb.wordlength.c_files import FLAGS
from gpbnb.wordlength.code import write_code

STEPS = 10_000
COMPILERS = ("gcc", "clang")
LEVELS = ("-O0", "-O2")
SANITIZER = "-fsanitize=undefined -fno-sanitize-recover=all"
RESULTS = Path(__file__).parent / "results"
JOURNAL = Path(__file__).parent.parent / ".cache" / "code.csv"
BATCH = 30
"""Combinations that are compiled into one program."""

KINDS = ("binary32", "binary64", "int16", "int32", "int48", "int64", "words")
"""Kinds of formats, as the results list them."""


# -- formats ------------------------------------------------------------------------------------------


_KEPT = ("saturate", "raise")
ROUNDINGS = [each for each in Rounding if each is not Rounding.STOCHASTIC]


def fixed(
    integer: int, widths: Sequence[int], overflows: Sequence[str] = ("saturate", "wrap", "raise"), first: int = 0
) -> Iterator[tuple[str, FixedFormat]]:
    """Fixed point with every rounding in words of these widths; overflows take turns, beginning with the first."""
    for i, (bits, rounding) in enumerate(product(widths, ROUNDINGS)):
        overflow = overflows[(first + i + i // len(ROUNDINGS)) % len(overflows)]
        yield f"int{bits}", FixedFormat(integer, bits - 1 - integer, rounding, overflow)


def words(integer: int) -> Iterator[tuple[str, WordFormats]]:
    """Words with formats of their own for coefficients and sums, as signal processors have them."""
    overflows = cycle(("saturate", "wrap"))
    for rounding in ROUNDINGS:
        data = FixedFormat(integer, 15 - integer, rounding, next(overflows))
        yield (
            "words",
            WordFormats(data, FixedFormat(4, 11, rounding), FixedFormat(integer + 5, 26 - integer, rounding, "wrap")),
        )
        yield "words", WordFormats(data, 12, FixedFormat(integer + 8, 31 - integer, rounding, next(overflows)))
        longer = FixedFormat(integer, 31 - integer, rounding, next(overflows))
        yield "words", WordFormats(longer, 24)
        yield (
            "words",
            WordFormats(
                longer, FixedFormat(4, 27, rounding), FixedFormat(integer + 8, 55 - integer, rounding, "saturate")
            ),
        )
        longest = FixedFormat(integer, 47 - integer, rounding, next(overflows))
        yield (
            "words",
            WordFormats(longest, FixedFormat(4, 43), FixedFormat(integer + 4, 59 - integer, rounding, "wrap")),
        )


FLOATS = (("binary32", BINARY32), ("binary64", BINARY64))


# -- filters ------------------------------------------------------------------------------------------


def designs() -> dict[str, tuple[Any, Any]]:
    """Digital filters by b and a: the two low-pass sections in a row, and others of order 1 to 5."""
    angle = 2 * math.pi * 440 / 44100
    alpha = math.sin(angle) / 2
    section_b = np.array([1 - math.cos(angle), 2 - 2 * math.cos(angle), 1 - math.cos(angle)]) / (2 + 2 * alpha)
    section_a = np.array([1 + alpha, -2 * math.cos(angle), 1 - alpha]) / (1 + alpha)
    poles = np.array([0.5 + 0.3j, 0.5 - 0.3j, 0.2 + 0.7j, 0.2 - 0.7j, -0.4])
    return {
        "two low-pass sections": (np.convolve(section_b, section_b), np.convolve(section_a, section_a)),
        "order 5": (0.05 * np.array([1, 0.3, -0.25, 0.75, 0.5, 1.0]), np.poly(poles).real),
        "order 1": (["0.25"], [1, "-0.75"]),
        "more zeros": ([0.125, 0, -0.25, 0.1], [2, -0.5]),
    }


CONTROLLERS: tuple[dict[str, Any], ...] = (
    {},
    {"Kd": "0.7"},
    {"limits": ("-0.8", "0.9")},
    {"Kd": "0.3", "limits": ("-1.1", "0.4"), "back_calculation": "0.6", "leak": "0.99"},
    {"integral_limits": ("-0.25", "0.3"), "Kd": "-0.2"},
    {"integral_limits": ("-0.5", "0.5"), "limits": ("-1", "1"), "back_calculation": "0.3", "Kd": "1.3", "leak": "0.9"},
)


def systems() -> Iterator[tuple[str, Any, Any]]:
    """Name, filter and structure of everything that is no Kalman filter."""
    for name, (b, a) in designs().items():
        for structure in STRUCTURES:
            yield f"{name}, {structure}", FilterDesign(b, a, name=name), structure
    yield "FIR", FilterDesign(["0.1", "0.2", "-0.3", "0", "0.4"]), "FIR"
    yield "smoother", LinearSystem.smoother("1097/4096"), None
    for i, settings in enumerate(CONTROLLERS):
        yield f"controller {i + 1}", LinearSystem.pid("0.8", "0.1", **settings), None
    rng = np.random.default_rng(5)
    A = rng.uniform(-0.4, 0.4, (3, 3))
    A[0, 2] = A[1, 0] = 0
    yield (
        "two inputs, two outputs",
        LinearSystem(A, rng.uniform(-1, 1, (3, 2)), rng.uniform(-1, 1, (2, 3)), [[0, 1], [0, "0.5"]], [1, 0, "0.25"]),
        None,
    )


def models() -> dict[str, LinearModel]:
    """Kalman filters: one state, three states and two correlated sensors, and one whose sensor changes."""
    return {
        "one state": LinearModel([["0.95"]], [[1]], [["0.25"]], [["0.5"]], ["0.5"], [[2]], "one state"),
        "three states": LinearModel(
            [[1, "0.1", 0], [0, 1, "0.1"], [0, 0, "0.9"]], [[1, 0, 0], ["0.5", 1, 0]],
            np.diag([1, 2, 3]) / 16, [[1, 0.25], [0.25, 2]], [0, 0, 0], np.diag([4, 4, 4]), "three states",
        ),
        "a cycle of three": LinearModel(
            [["0.9", "0.2"], ["-0.1", "0.8"]], [[[1, 0]], [["0.6", "0.8"]], [[0, 1]]],
            [[[0.25, 0.0], [0.0, 0.5]]], [[[1]], [["0.5"]], [[2]]], [0, 0], np.diag([1, 2]), "a cycle of three",
        ),
    }  # fmt: skip


def large_model() -> LinearModel:
    """Ten states, two sensors."""
    rng = np.random.default_rng(10)
    Phi = np.eye(10) * 0.9 + np.diag(np.full(9, 0.1), 1) + 0.02 * rng.standard_normal((10, 10))
    return LinearModel(
        Phi, rng.standard_normal((2, 10)), np.eye(10) / 64, np.eye(2), np.zeros(10), np.eye(10), "ten states"
    )


def cases() -> Iterator[Case]:
    """All combinations."""
    for i, (label, given, structure) in enumerate(systems()):
        formats = [*FLOATS, *fixed(6, (16,), first=i), *fixed(12, (32, 64), first=i)]
        formats += [each for j, each in enumerate(words(6)) if (i + j) % 3 == 0]
        for kind, fmt in formats:
            yield Case(kind, label, given, fmt, structure)
    for label, model in models().items():
        for i, form in enumerate(Form):
            # Only these overflows have an emulation in compiled loops.
            for kind, fmt in [*FLOATS, *fixed(5, (16,), _KEPT, i), *fixed(8, (32, 48), _KEPT, i)]:
                yield Case(kind, f"{label}, {form}", model, fmt, form)
        if "cycle" not in label:
            for kind, fmt in [*FLOATS, *fixed(5, (16,)), *fixed(8, (32, 64)), *words(5)]:
                yield Case(kind, f"{label}, {CONSTANT_GAIN}", model, fmt, CONSTANT_GAIN)
    for form in Form:
        yield Case("binary32", f"ten states, {form}", large_model(), BINARY32, form)
    for label, model in models().items():
        for i, form in enumerate(each for each in Form if each is not Form.UD):
            # Python's integers emulate words that are long or wrap around.
            for kind, fmt in [*fixed(3, (16,), ("wrap",)), *fixed(8, (64,), first=i)]:
                yield Case(kind, f"{label}, {form}", model, fmt, form)


def installed(names: Sequence[str] = COMPILERS) -> list[str]:
    """The compilers of these that are installed."""
    return [each for each in names if shutil.which(each)]


def settings_of(compilers: Sequence[str], sanitize: bool = True) -> list[str]:
    """Each compiler at each level, and the first with the sanitizer of undefined behaviour."""
    settings = [f"{compiler} -pipe {level}" for compiler in compilers for level in LEVELS]
    return [*settings, f"{compilers[0]} -pipe -O1 {SANITIZER}"] if sanitize else settings


def code_digest(settings: Sequence[str]) -> str:
    """Eight characters that change with the code, what it is compared with, and the compilers."""
    sources = {Path(__file__), Path(code_batch.__file__), *caching.imported(Path(code.__file__))}
    about = [*settings, *map(version, installed())]
    return hashlib.sha256("\n".join([caching.digest(sources), *about]).encode()).hexdigest()[:8]


def run(
    share: float, steps: int, processes: int = 1, file: Path | None = JOURNAL, only: str = ""
) -> Iterator[list[Outcome]]:
    """Compare a share of all combinations in batches, those in the journal first.

    Parameters
    ----------
    only : text in the kind and name of each combination that is compared.
    """
    compilers = installed()
    if not compilers:
        raise OSError(f"got no compiler; needed {' or '.join(COMPILERS)}")
    settings = settings_of(compilers)
    journal = None if file is None else Journal(file, code_digest(settings))
    chosen = list(cases())
    count = max(1, round(len(chosen) * share))
    # Formats repeat with a period, so that equal distances would pick few of them.
    drawn = np.random.default_rng(0).permutation(len(chosen))[:count].tolist()
    picked = {f"{i}, {steps}": chosen[i] for i in drawn if only in f"{chosen[i].kind} {chosen[i].label}"}
    done = {part: journal.parts[part] for part in picked if part in journal.parts} if journal else {}
    yield [
        Outcome(picked[part], int(builds), int(steps), int(numbers), tuple(faults))
        for part, (builds, steps, numbers, *faults) in done.items()
    ]
    todo = [part for part in picked if part not in done]
    batches = [todo[i : i + BATCH] for i in range(0, len(todo), BATCH)]

    def finished(batch: list[str], outcomes: list[Outcome]) -> list[Outcome]:
        for part, outcome in zip(batch, outcomes, strict=True):
            if journal:
                journal.add(part, (*outcome.counts, *outcome.faults))
        return outcomes

    if processes == 1:
        for batch in batches:
            yield finished(batch, compare([picked[part] for part in batch], steps, settings))
    else:
        with ProcessPoolExecutor(processes) as pool:
            jobs = {pool.submit(compare, [picked[part] for part in batch], steps, settings): batch for batch in batches}
            for job in as_completed(jobs):
                yield finished(jobs[job], job.result())


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
    b, a = designs()["two low-pass sections"]
    u = np.random.default_rng(0).uniform(-1, 1, (steps, 1)).astype(np.float32)
    for structure in ("direct form I", "direct form II transposed", "cascade of direct form II transposed", "lattice"):
        design = FilterDesign(b, a, name="two low-pass sections")
        system = design.system(structure)
        (bound,) = output_errors(system, BINARY32, np.array([1.0]))
        expected = system.outputs(u, BINARY32)[:, 0, 0]
        for compiler, flags in product(installed(), BUILDS):
            with tempfile.TemporaryDirectory() as folder:
                write_code(design, BINARY32, structure, folder)
                (Path(folder) / "main.c").write_text(MAIN)
                command = [compiler, "-std=c99", "-O2", *flags.split(), "-DFILTER_FAST_MATH", "-o", "run"]
                subprocess.run([*command, "main.c", "filter.c"], cwd=folder, check=True)
                given = "\n".join(float(each).hex() for each in u[:, 0])
                done = subprocess.run(["./run"], cwd=folder, input=given, capture_output=True, text=True, check=True)
            found = np.array([float.fromhex(each) for each in done.stdout.split()])
            error = np.abs(found - expected)
            yield Change(structure, compiler, flags, steps, int((error > 0).sum()), float(error.max() / bound))


def write_changes(found: Sequence[Change]) -> None:
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


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.code", description=__doc__.split("\n")[0])
    parser.add_argument("--share", type=float, default=1.0, help="share of all combinations, 1 for all (default)")
    parser.add_argument("--only", default="", metavar="TEXT", help="combinations with this text in kind and name")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--store", action="store_true", help="store the counts after each batch, also those of a share")
    parser.add_argument("--flags", action="store_true", help="compare builds with other flags, and nothing else")
    options = parser.parse_args()
    if options.flags:
        write_changes([*changes(options.steps)])
        return 0
    start, outcomes = time.perf_counter(), list[Outcome]()
    total = len(list(cases()))
    with tqdm(total=None if options.only else round(total * options.share), unit="combination") as bar:
        for found in run(options.share, options.steps, options.processes, only=options.only):
            outcomes += found
            bar.update(len(found))
            if options.store:
                write(outcomes, total)
            for fault in (fault for outcome in found for fault in outcome.faults):
                bar.write(fault)
    different = sum(len(outcome.faults) for outcome in outcomes)
    print(
        f"{len(outcomes):,} combinations, {sum(each.builds for each in outcomes):,} builds and "
        f"{sum(each.numbers for each in outcomes):,} numbers agree, {different or 'no'} builds differ, "
        f"{time.perf_counter() - start:.0f} s"
    )
    if options.share == 1 and options.steps == STEPS and not options.only:
        write(outcomes, total)
    return 1 if different else 0


def write(outcomes: Sequence[Outcome], total: int) -> None:
    """Store the counts by format, with date, compilers and flags; `total` is the number of all combinations."""
    RESULTS.mkdir(exist_ok=True)
    body = []
    for kind in KINDS:
        mine = [outcome for outcome in outcomes if outcome.case.kind == kind]
        if mine:
            builds, steps, numbers = (sum(column) for column in zip(*(each.counts for each in mine), strict=True))
            different = sum(len(each.faults) for each in mine)
            body.append((kind, *(f"{count:,}" for count in (len(mine), builds, steps, numbers, different))))
    header = ("format", "combinations", "builds", "steps compared", "numbers compared", "different")
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    about = (
        f"Compared {len(outcomes):,} of {total:,} combinations on {date} on {platform.machine()} with "
        f"{'; '.join(map(version, installed()))}; flags {FLAGS} with {' and '.join(LEVELS)}, and -O1 {SANITIZER}."
    )
    table = Table("code", header, tuple(body)).markdown()
    (RESULTS / "code.md").write_text(f"{table}\n\n{about}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
