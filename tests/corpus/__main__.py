"""The golden corpus: ``python -m tests.corpus`` compares seeded runs with the hashes of their digits.

A run that differs is named with the checkpoint from which on its digits differ. ``--against PATH`` runs the same
generator on the package of another checkout, and names the first step and quantity that differ.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
import os
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

from gpbnb.arithmetic.kernels import backends
from tests.corpus.draw import Draw
from tests.corpus.families import FAMILIES, Case, Questions

HASHES = Path(__file__).parent / "hashes.csv"
ROOT = Path(__file__).parents[2]
HEADER = ("run", "title", "seed", "steps", "digits", "checkpoints", "values")

TOLERANCES = {"ratio": 1e-9, "bound": 0.02}
"""Relative tolerances of quantities whose last digits may change: errors over a tolerance in a search, and bounds."""


class Row(NamedTuple):
    """What is stored of a run.

    Parameters
    ----------
    run, title : its name, and what it is.
    seed : of its inputs.
    steps : how many.
    digits : hash of all exact numbers.
    checkpoints : hashes of the numbers up to steps 1, 2, 4, 8 …, shorter.
    values : what is compared by a tolerance.
    """

    run: str
    title: str
    seed: str
    steps: str
    digits: str
    checkpoints: str
    values: str


def names(only: str = "") -> list[str]:
    """Names of all runs; of the one with this name; or of those that contain this text."""
    every = [f"{family} {i}" for family, (count, _) in FAMILIES.items() for i in range(count)]
    return [only] if only in every else [each for each in every if only in each]


def drawn(name: str, seed: int = 0) -> tuple[Case | Questions, int]:
    """The run of a name, and the seed of its inputs; another seed gives other inputs."""
    family, i = name.rsplit(" ", 1)
    draw = Draw(name, seed)
    return FAMILIES[family].drawn(draw, int(i)), draw.seed


def text(value: Any) -> str:
    """Numbers as text that is the same for equal numbers of any type."""
    if isinstance(value, str):
        return value
    if isinstance(value, (list, tuple)):
        return f"[{','.join(map(text, value))}]"
    exact = Fraction(value)
    return f"{exact.numerator:x}/{exact.denominator:x}"


def row(name: str) -> Row:
    """Run a run."""
    import tests.corpus.package as package

    run, seed = drawn(name)
    whole, checkpoints, values, count = hashlib.sha256(), [], [], 0
    for step in run.steps(package):
        count += 1
        for quantity, value in step.items():
            if quantity in TOLERANCES:
                values += [f"{quantity} {each:.12g}" for each in (value if isinstance(value, list) else [value])]
            else:
                whole.update(f"{quantity} {text(value)}\n".encode())
        if count & (count - 1) == 0:
            checkpoints.append(whole.hexdigest()[:6])
    return Row(name, run.title, str(seed), str(count), whole.hexdigest()[:16], " ".join(checkpoints), "; ".join(values))


def timed(name: str) -> tuple[Row, float]:
    """Run a run; also return its seconds of the processor."""
    start = time.process_time()
    try:
        found = row(name)
    except Exception as error:  # a run that cannot be run differs
        found = Row(name, "", "", "", f"{type(error).__name__}: {error}", "", "")
    return found, time.process_time() - start


def confirmed(name: str, seed: int = 0) -> tuple[int, str]:
    """How many quantities of a run the oracle confirms, and the first that it does not; 0 if it has no answer."""
    import tests.corpus.oracle as oracle
    import tests.corpus.package as package

    run, count = drawn(name, seed)[0], 0
    if isinstance(run, Case) and not hasattr(oracle, run.function):
        return 0, ""
    try:
        expected = list(run.steps(oracle))
    except NotImplementedError:
        return 0, ""
    found = list(run.steps(package))
    for k, step in enumerate(expected, start=1):
        for quantity, value in step.items():
            here = found[k - 1].get(quantity, "") if k <= len(found) else ""
            if text(here) != text(value):
                return count, f"{run.title}: step {k}, {quantity}: {here!s:.200}, but the oracle {value!s:.200}"
            count += 1
    if len(found) > len(expected) + 1:
        return count, f"{run.title}: the oracle ends after {len(expected)} steps of {len(found)}"
    return count, ""


def stored() -> dict[str, Row]:
    if not HASHES.exists():
        return {}
    with HASHES.open(encoding="utf-8", newline="") as stream:
        return {each[0]: Row(*each) for each in list(csv.reader(stream))[1:]}


def store(rows: dict[str, Row]) -> None:
    with HASHES.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(HEADER)
        writer.writerows(rows[name] for name in names() if name in rows)


def difference(found: Row, expected: Row | None) -> str:
    """Where a run differs from what is stored; empty if it does not."""
    if not found.title:
        return found.digits
    if expected is None:
        return "is not stored"
    if found.seed != expected.seed or found.title != expected.title:
        return f"has other inputs: {found.title}, stored {expected.title}"
    pairs = zip(found.checkpoints.split(), expected.checkpoints.split(), strict=False)
    for k, (a, b) in enumerate(pairs):
        if a != b:
            return f"differs in step {2**k}" if k < 2 else f"differs after step {2 ** (k - 1)}, up to step {2**k}"
    if (found.steps, found.digits) != (expected.steps, expected.digits):
        return f"differs after step {2 ** (len(expected.checkpoints.split()) - 1)}, of {expected.steps}"
    return near(found.values, expected.values)


def near(found: str, expected: str) -> str:
    """Where values differ by more than their tolerance."""
    both = found.split("; "), expected.split("; ")
    if len(both[0]) != len(both[1]):
        return f"has {len(both[0])} values, stored {len(both[1])}"
    for a, b in zip(*both, strict=True):
        if a != b:
            (quantity, x), (_, y) = a.split(), b.split()
            if not math.isclose(float(x), float(y), rel_tol=TOLERANCES[quantity]):
                return f"has a {quantity} {x}, stored {y}"
    return ""


# -- another checkout -------------------------------------------------------------------------------------------------


_DUMPED = """
import sys
from importlib import util
sys.path.insert(0, {checkout!r})
import gpbnb
sys.path[0] = {here!r}
spec = util.spec_from_file_location("tests.corpus.package", {adapter!r})
sys.modules[spec.name] = module = util.module_from_spec(spec)
spec.loader.exec_module(module)
from tests.corpus.__main__ import dump
dump({names!r})
"""
"""A program that runs this generator on the package of a checkout, with the adapter of that checkout if it has one."""


def dump(chosen: list[str]) -> None:
    """Print each quantity of each step of some runs as a line of JSON."""
    import tests.corpus.package as package

    for name in chosen:
        for k, step in enumerate(drawn(name)[0].steps(package), start=1):
            for quantity, value in step.items():
                print(json.dumps([name, k, quantity, value if quantity in TOLERANCES else text(value)]))


def dumped(checkout: Path, chosen: list[str]) -> dict[str, list[Any]]:
    """Steps, quantities and values of runs on the package of a checkout."""
    adapter = checkout / "tests" / "corpus" / "package.py"
    adapter = adapter if adapter.exists() else ROOT / "tests" / "corpus" / "package.py"
    code = _DUMPED.format(checkout=str(checkout), here=str(ROOT), adapter=str(adapter), names=chosen)
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, list[Any]] = {name: [] for name in chosen}
    for line in done.stdout.splitlines():
        name, *rest = json.loads(line)
        found[name].append(rest)
    return found


def against(checkout: Path, chosen: list[str]) -> int:
    """Print the first step and quantity in which a run differs on the package of another checkout."""
    there, here, wrong = dumped(checkout, chosen), dumped(ROOT, chosen), 0
    for name in chosen:
        pairs = zip(there[name], here[name], strict=False)
        fault = next(
            (f"step {b[0]}, {b[1]}: {a[2]!s:.200} there, {b[2]!s:.200} here" for a, b in pairs if not same(a, b)), ""
        )
        if not fault and len(there[name]) != len(here[name]):
            fault = f"{len(there[name])} quantities there, {len(here[name])} here"
        if fault:
            wrong += 1
            print(f"{name}: {fault}")
    print(f"{len(chosen)} runs, {wrong or 'none'} different")
    return wrong


def same(a: Any, b: Any) -> bool:
    """Whether two quantities are equal, or within their tolerance."""
    if a[:2] != b[:2] or a[1] not in TOLERANCES:
        return bool(a == b)
    both = (each if isinstance(each, list) else [each] for each in (a[2], b[2]))
    return all(math.isclose(x, y, rel_tol=TOLERANCES[a[1]]) for x, y in zip(*both, strict=True))


def confirm(chosen: list[str], seed: int, processes: int) -> int:
    """Compare runs with the oracle, and count for each family what it confirms, refutes, and cannot answer."""
    counts: dict[str, list[int]] = {}
    with ProcessPoolExecutor(processes) as pool:
        for name, (count, fault) in zip(chosen, pool.map(confirmed, chosen, [seed] * len(chosen)), strict=True):
            mine = counts.setdefault(name.rsplit(" ", 1)[0], [0, 0, 0, 0])
            mine[0 if fault else 1 if count else 2] += 1
            mine[3] += count
            if fault:
                print(f"{name}: {fault}", flush=True)
    for family, (wrong, right, unknown, quantities) in counts.items():
        total = right + wrong + unknown
        print(f"  {family}: {right} of {total} runs confirmed, {quantities:,} quantities; {wrong} differ")
    wrong = sum(each[0] for each in counts.values())
    print(f"{len(chosen)} runs, {sum(each[1] for each in counts.values())} confirmed, {wrong or 'none'} different")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.corpus", description=__doc__.split("\n")[0])
    parser.add_argument("--only", default="", metavar="TEXT", help="runs whose name contains this text")
    parser.add_argument("--renew", action="store_true", help="store the hashes as they are now")
    parser.add_argument(
        "--against",
        type=Path,
        metavar="PATH",
        help="compare with another checkout, step by step",
    )
    parser.add_argument("--confirm", action="store_true", help="compare with the oracle, which shares no code")
    parser.add_argument("--seed", type=int, default=0, help="of other inputs to compare with the oracle")
    parser.add_argument("--slice", default="0/1", metavar="I/K", help="every K-th run, from the I-th")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    backends.LOOPS_AFTER = 0  # loops are compared, not what exact arithmetic computes before
    first, every = map(int, options.slice.split("/"))
    chosen = names(options.only)[first::every]
    if options.confirm:
        return 1 if confirm(chosen, options.seed, options.processes) else 0
    if options.against:
        return 1 if against(options.against.resolve(), chosen) else 0
    known, wrong, seconds = stored(), 0, Counter[str]()
    with ProcessPoolExecutor(options.processes) as pool:
        for name, (found, spent) in zip(chosen, pool.map(timed, chosen), strict=True):
            fault = difference(found, known.get(name))
            wrong += bool(fault)
            seconds[name.rsplit(" ", 1)[0]] += spent
            if fault:
                print(f"{name} ({found.title}): {fault}", flush=True)
            if options.renew and found.title:
                known[name] = found
                store(known)
    for family, each in seconds.items():
        print(f"  {family}: {each:.1f} s")
    what = "changed" if options.renew else "different"
    print(f"{len(chosen)} runs, {wrong or 'none'} {what}, {sum(seconds.values()):.0f} s of the processor")
    return 1 if wrong and not options.renew else 0


if __name__ == "__main__":
    sys.exit(main())
