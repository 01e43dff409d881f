"""Calls and what is stored of them, in sections: answers.txt, refused.txt and shown.txt.

A section of answers.txt is named after the module whose names its calls use. A value is stored to so many digits that a
mistake changes it: the answer says that nothing changed, not that it is right. refused.txt has the whole message of
each call that is refused, by the function that refuses, and shown.txt the whole text of what users are shown.

`python -m tests.test_answers` stores what the calls say today, `python -m tests.test_answers answers` those of one
file, and `python -m tests.test_answers answers bounds` those of the sections whose names contain a word; `git diff`
shows what has changed.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import html
import inspect
import io
import math
import os
import re
import runpy
import shlex
import subprocess
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Mapping
from enum import Enum
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import Collection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

import gpbnb
from gpbnb.__main__ import main as top
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.bounds.check import main as check
from gpbnb.filters.blocks import BLOCKS
from gpbnb.filters.design import FilterDesign
from gpbnb.report.ledger import checking
from gpbnb.report.ledger import command as ledger
from gpbnb.report.ledger import judge as judging
from gpbnb.report.ledger.statements import statement
from gpbnb.report.stored import main as sweeps
from gpbnb.wordlength import report
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.code import prepared
from tests import small_filter
from tests.filters.test_model import GOOD as TWO

ROOT = Path(__file__).resolve().parents[1]
STORED = {name: Path(__file__).with_name(f"{name}.txt") for name in ("answers", "refused", "shown")}
FILES = {
    "m.toml": "Phi=[[1,1],[0,1]]\nH=[[1,0]]\nQ=[[1,0],[0,1]]\nR=[[1]]\nx0=[0,0]\nP0=[[1,0],[0,1]]\n",
    "s.toml": "A=[['0.9']]\nB=[['0.1']]\n",
    "z.csv": "1\n2\n3\n",
    "timed.csv": "t (s),z (m)\n0,1\n1,2\n2,3\n",
    "data.json": "1\n2\n3\n",
    "own.json": "{}",
    "notes.html": "{}",
    "own.py": "def step(fmt, x, u):\n    return x, u\n\n\ndef mean(fmt, z):\n    return z[0]\n\n\nrate = 3\n",
    "syntax.py": "def f(x):\n    retrn x\n",
    "lacks.py": "import nowhere_at_all\n",
    "leaves.py": "raise SystemExit(3)\n",
    "named.toml": (
        'name = "tracker <1>"\nstates = ["range (m)", "rate (m/s)"]\nmeasurements = ["radar (m)"]\n'
        "Phi = [[1, 0.1], [0, 1]]\nH = [[1, 0]]\nQ = [[1e-4, 0], [0, 1e-2]]\nR = [[0.01]]\nx0 = [0, 0]\n"
        "P0 = [[100, 0], [0, 100]]\n"
    ),
    "biquad.toml": 'name = "low-pass"\nb = [0.1, 0.2, 0.1]\na = [1, -1.2, 0.5]\nstructure = "all"\n',
    "cascade.toml": (
        "sos = [[0.1, 0.2, 0.1, 1, -1.2, 0.5], [1, -1, 0, 1, -0.5, 0.25]]\n"
        'structure = "cascade of direct form II transposed"\norder = "down"\nscale = true\n'
    ),
    "taken.py": "def step(fmt, x, u):\n    return [x[0] + u[0] / 8], [x[0]]\n",
    "own.toml": 'step = "taken.py:step"\nx0 = [0]\n',
}
COMMANDS = {"wordlength": main, "gpbnb": top, "ledger": ledger.main, "sweeps": sweeps, "check": check}


class Refused(Exception):
    """What the command wrote as it refused."""


def command(arguments):
    """Ask the command, with a tolerance and the simplest basis if it is given none."""
    asked = arguments.split()
    for option, value in {"--tolerance": "1", "--basis": "emulation"}.items():
        asked += [] if option in asked else [option, value]
    with contextlib.redirect_stderr(io.StringIO()) as shown, contextlib.redirect_stdout(io.StringIO()):
        status = main(asked)
    if status == 2:
        raise Refused(shown.getvalue().removeprefix("python -m gpbnb.wordlength: ").rstrip("\n"))


def ran(line):
    """What a command prints, an error after "! ", and its exit status unless it is 0."""
    name, *words = shlex.split(line)
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="")
    with contextlib.redirect_stderr(io.StringIO()) as err, contextlib.redirect_stdout(out):
        try:
            status = COMMANDS[name](words)
        except SystemExit as end:
            status = end.code
    out.flush()
    lines = [*out.buffer.getvalue().decode().splitlines(), *(f"! {line}" for line in err.getvalue().splitlines())]
    return "\n".join([*lines, *([f"status {status}"] if status else [])])


def read(page):
    """What is read on a page, a line for each paragraph and row, with bars between cells; versions are left out."""
    body = re.sub(r"<style>.*</style>", "", Path(page).read_text(encoding="utf-8"), flags=re.DOTALL)
    plain = re.sub(r"<[^>]*>", "", re.sub(r"</t[hd]>(?=<t)", " | ", re.sub(r"\n\n[^<]*</pre>", "", body)))
    return "\n".join(line for line in html.unescape(plain).split("\n") if line.strip())


def files(folder, *names):
    """The text of generated files, without the numbers of test vectors."""
    return "\n".join(f"== {name}\n{Path(folder, name).read_text(encoding='utf-8')}" for name in names)


def made(words):
    """The commands that make would run, with what few targets need installed."""
    ready = [word for each in ("made-for", "with-dev", "with-pages", "with-bench") for word in ("-o", f".venv/{each}")]
    asked = ["make", "--no-print-directory", "-n", *ready, *shlex.split(words)]
    env = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")}
    done = subprocess.run(asked, cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    return (done.stdout + done.stderr).replace(str(ROOT), ".").replace("\\\n", "\n")


def script(name):
    return SimpleNamespace(**runpy.run_path(str(ROOT / "scripts" / f"{name}.py")))


def true_values(topic):
    """For each domain of a topic in the ledger a hash of its values, without the domains that take seconds."""
    found = {}
    for key, row in checking.TOPICS[topic].items():
        if row.domain and row.domain not in found and row.domain.partition("(")[0] not in SLOW:
            names = {**judging._NAMES, "printed": statement(key), "document": statement(key).document, **row.topic}
            values = judging._value(row.domain, names)
            found[row.domain] = hashed(written(evaluated(values if isinstance(values, Mapping) else list(values))))
    found["other functions"] = hashed(written(returned(topic)))
    return "\n".join(f"{domain}: {values}" for domain, values in found.items())


def evaluated(value):
    """A value with what its functions of one argument return for two whole numbers in place of the functions."""
    if isinstance(value, Mapping):
        return {name: evaluated(each) for name, each in value.items()}
    if type(value) in (list, tuple):
        return [evaluated(each) for each in value]
    return for_each(value, 1, 2) if inspect.isfunction(value) and len(parameters(value)) == 1 else value


def parameters(function):
    """Those without a default."""
    return [each for each in inspect.signature(function).parameters.values() if each.default is each.empty]


def returned(topic):
    """What each function of the checks of a topic returns that takes no argument, and is no domain, as a hash."""
    checks, found = checking.TOPICS[topic].values(), {}
    others = {*SLOW, *ROUNDED, *(row.domain.removesuffix("()") for row in checks)}
    for name, each in next(iter(checks)).topic.items():
        plain = inspect.unwrap(each) if callable(each) and name not in others else None
        if inspect.isfunction(plain) and ".checks." in plain.__module__ and not parameters(plain):
            found[name] = hashed(written(evaluated(each())))
    return found


def drawn(figure):
    """What a figure draws, axes by axes: the numbers, colours and names of its lines and areas, and its texts."""
    figure.canvas.draw()
    found = []
    for ax in figure.axes:
        found.append([ax.get_xlim(), ax.get_ylim(), ax.get_xscale(), ax.get_yscale()])
        for each in ax.findobj():
            if isinstance(each, Line2D):
                found.append([each.get_label(), each.get_color(), each.get_ls(), each.get_marker(), each.get_xydata()])
            elif isinstance(each, Text) and each.get_text():
                found.append([each.get_text(), each.get_color(), each.get_fontsize(), np.array(each.get_position())])
            elif isinstance(each, Patch):
                look = each.get_label(), each.get_facecolor(), each.get_ls(), each.get_visible()
                found.append([*look, each.get_path().vertices])
            elif isinstance(each, Collection):
                parts = [path.vertices for path in each.get_paths()]
                found.append([each.get_label(), each.get_facecolor(), each.get_offsets(), *parts])
    plt.close(figure)
    return found


def given(content, name="given.toml"):
    """Write a file; return its name."""
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    return name


def model(**changes):
    return gpbnb.LinearModel(**TWO | changes)


def mapping(**changes):
    return {name: each for name, each in (TWO | changes).items() if each is not None}


def driven():
    return model(B=[[1], [0]], u=[[1]] * 5)


def nonlinear(**changes):
    noise = {"Q": [[0, 0], [0, "0.01"]], "R": [["0.5", "0.1"], ["0.1", 1]], "x0": [0, 1], "P0": [[1, 0], [0, 1]]}
    return gpbnb.NonlinearModel(**{"f": lambda x: x, "F": None, "h": lambda x: x, "H": None} | noise | changes)


def ask(model=None, z=60, tolerance=1e-3, **options):
    return gpbnb.required_precision(model or gpbnb.LinearModel(**TWO), z, tolerance, **options)


def blocks(**changes):
    return gpbnb.BlockFormats(**dict.fromkeys(BLOCKS, gpbnb.BINARY32) | changes)


def stepped(step):
    return prepared(gpbnb.NonlinearSystem(step, [1]), gpbnb.BINARY32, None)


def replaced(module, call, **made):
    """What a call returns with other functions in a module of the report, which need not compute for minutes."""
    with mock.patch.multiple(f"gpbnb.report.{module}", **made):
        return call()


def for_each(function, *values):
    """The answer to each value, or its refusal."""
    found = []
    for value in values:
        try:
            found.append(function(value))
        except Exception as error:
            found.append(error)
    return found


SLOW = (
    *("approach", "reliability", "splits", "joint_use", "index_ranges", "two_parts", "solved_columns"),
    *("density_of_noise", "recursively", "five_sources", "shortcut", "much_less", "not_completely", "exact_errors"),
    *("chains", "open_studies", "model_is_right", "coarse_is_wider", "shortcut_text", "examples_in_four_digits"),
    *("_misprints", "all_pairs", "filter_study", "walk_errors", "expected_squares", "sources_4_and_5", "optimum"),
)
ROUNDED = "drift_error", "deroll_errors", "errors_of_the_set", "_folded", "recursion", "rolled_spins"
"""What returns only rounding errors of float64, which differ from machine to machine."""
D4, B8 = gpbnb.FloatFormat(10, 4), gpbnb.FloatFormat(2, 8)
HERE = {
    "D4": D4,
    "B8": B8,
    "FMT": gpbnb.FloatFormat(2, 24),
    "Q": gpbnb.FixedFormat(3, 12),
    "KINDS": (
        *(gpbnb.FloatFormat(2, 24), gpbnb.FloatFormat(2, 8, "even"), gpbnb.FloatFormat(2, 5, "up"), gpbnb.BINARY16),
        *(gpbnb.FloatFormat(10, 4), gpbnb.FloatFormat(10, 3, "down"), gpbnb.FloatFormat(2, 70, "half up")),
        *(gpbnb.FloatFormat(16, 3, "chop"), gpbnb.FloatFormat(2, 8, "odd"), gpbnb.FP8_E4M3, gpbnb.FixedFormat(5, 6)),
        *(gpbnb.FixedFormat(5, 6, "half up", "saturate"), gpbnb.FloatFormat(2, 6, "stochastic", seed=3)),
    ),
    "V": D4.array(["1.5", "-2", "0"]),
    "W": B8.array([1, 2, 3]),
    "ONE": np.ones((2, 2)),
    "rows": lambda n: D4.array(np.arange(1, n * n + 1).reshape(n, n)),
    "WALK": gpbnb.LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]]),
    "TURNING": gpbnb.LinearModel(  # cycles of two and three steps
        *([[1, "0.5"], [0, 1]], [[[1, 0], [0, 1]], [[1, 1], [0, 2]]], [["0.25", 0], [0, 1]]),
        *([[[1, "0.5"], ["0.5", 1]], [[1, 0], [0, 4]], [[2, -1], [-1, 1]]], [0, 0], [[1, 0], [0, 1]]),
    ),
    "SMALL": small_filter.model(),
    "Z": small_filter.measurements(),
    "SYSTEM": gpbnb.LinearSystem([["0.9"]], [["0.1"]]),
    "BIQUAD": FilterDesign(["0.1", "0.2", "0.1"], [1, "-1.2", "0.5"]),
    "CASCADE": FilterDesign(sos=[["0.1", "0.2", "0.1", 1, "-1.2", "0.5"], [1, 1, 0, 2, "-0.5", "0.25"]]),
    "SWING": gpbnb.NonlinearModel(
        *(lambda x: np.stack([x[0] + x[1] / 8, x[1] - np.sin(x[0]) / 8]), None),
        *(lambda x: np.stack([np.cos(x[0]), x[1] * x[0]]), None, [[0, 0], [0, "0.01"]], [["0.5", "0.1"], ["0.1", 1]]),
        *([1, "0.25"], [["0.1", 0], [0, 1]]),
    ),
    "STEP": gpbnb.NonlinearSystem(lambda fmt, x, u: (x + u / 8, x), [0]),
    "WITHIN": gpbnb.limits(measurement=0.001),
    "MIMO": ([[0.5, 0.1], [-0.2, 0.8]], [[1.0, 0.3], [0.2, -1.0]], [[1.0, 2.0], [0.5, -1.0]], [[0.1, 0], [0, 0.2]]),
    "TOML": FILES["m.toml"],
}
LIBRARIES = "control copy math mpmath operator dataclasses datetime decimal fractions flint scipy.signal"
ROOMS = (
    "arithmetic.array arithmetic.bounds arithmetic.derivatives arithmetic.rational bounds.inverse bounds.gains "
    "bounds.guarantee bounds.guess bounds.system filters.design filters.emulation filters.poles filters.run "
    "filters.settled filters.simulation filters.structures report.integration.precision report.integration.theory "
    "wordlength.code wordlength.models wordlength.required"
)


def public(module):
    return {name: each for name, each in vars(module).items() if not name.startswith("_")}


def names(section):
    """What calls of a section may use: what is public here, in LIBRARIES and ROOMS, and in the module of its name."""
    HERE["KINDS"][-1].restart()  # so that its random roundings do not depend on other sections
    found = {}
    for path in [*LIBRARIES.split(), *(f"gpbnb.{room}" for room in ROOMS.split())]:
        module = import_module(path)
        found |= {path.rpartition(".")[2]: module} | public(module)
    found |= {name: getattr(gpbnb, name) for name in gpbnb.__all__} | public(sys.modules[__name__]) | HERE
    return found | (public(import_module(section)) if section.startswith("gpbnb.") else {})


@functools.cache
def texts(stored):
    """For each section the calls, each with its stored text."""
    found, part = {}, []
    for line in STORED[stored].read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            part = found.setdefault(line.removeprefix("# "), [])
        elif line and not line.startswith("    "):
            part.append((line, []))
        elif part:
            part[-1][1].append(line[4:])
    return {name: [(call, "\n".join(lines).rstrip("\n")) for call, lines in part] for name, part in found.items()}


@contextlib.contextmanager
def folder(stored):
    """The files, in the current folder; nothing is computed before a call is refused, and no file is changed."""
    with tempfile.TemporaryDirectory() as path, contextlib.chdir(path), pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "100")
        patch.setattr(ledger, "_PAUSE", math.inf)  # a slow ledger does not say how far it is
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        if stored != "refused":
            yield
            return
        Path("folder").mkdir()
        os.symlink("z.csv", "linked.html")
        os.link("z.csv", "hard.html")
        patch.setattr(report, "study", mock.Mock(side_effect=AssertionError("something was computed")))
        yield
        assert not Path("code").exists()
        assert {name: Path(name).read_text(encoding="utf-8") for name in FILES} == FILES


def real(x, largest=0.0):
    """Ten digits, fewer where a number is small beside the largest of its array."""
    if not math.isfinite(x) or not x:
        return f"{x or 0:.10g}"
    places = min(9, 12 + math.floor(math.log10(abs(x))) - math.floor(math.log10(largest or abs(x))))
    return f"{x:.{places + 1}g}" if places >= 0 else "0"


def reals(array):
    """Numbers, of more than twelve some, and two sums in which each counts."""
    flat = array.ravel().tolist()
    largest = max((abs(each) for each in flat if math.isfinite(each)), default=0)
    if len(flat) <= 12:
        return " ".join(real(each, largest) for each in flat)
    finite = np.nan_to_num(array.ravel(), posinf=largest, neginf=-largest)
    first, second = finite @ np.linspace(1, 2, len(flat)), np.abs(finite) @ np.linspace(2, 1, len(flat))
    return f"{real(flat[0], largest)} … {real(flat[-1], largest)} ({len(flat)}; {real(first, second)} {real(second)})"


def several(said):
    """Texts one after the other, of more than twelve some, and a hash of all."""
    said = [each if len(each) <= 100 else f"{each[:30]}…{each[-30:]} ({len(each)}; {hashed(each)})" for each in said]
    if len(said) <= 12:
        return " ".join(said)
    return f"{said[0]} {said[1]} … {said[-1]} ({len(said)}; {hashed(' '.join(said))})"


def hashed(text):
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def attributes(value):
    for name in dir(value):
        if not name.startswith("_"):
            try:
                each = getattr(value, name)
            except Exception as error:
                each = error
            if not callable(each):
                yield name, each


def written(value, depth=0):
    """A value as text; an object by its public attributes, the objects in it by theirs."""
    if isinstance(value, Exception):
        return f"{type(value).__name__}: {value}"
    if isinstance(value, str) and value.startswith('{"certificate"'):
        return "a certificate"  # which contains other numbers on another machine
    if isinstance(value, complex | np.complexfloating):
        return f"{written(value.real)}{'+' if value.imag >= 0 else ''}{written(value.imag)}j"
    if isinstance(value, float | np.floating):
        return real(float(value))
    if isinstance(value, gpbnb.FloatArray):
        value = np.array([str(each) for each in value.ravel()], dtype=object).reshape(value.shape)
    if isinstance(value, np.ndarray):
        shape = f"{value.shape} " if value.ndim != 1 else ""
        if value.dtype.kind == "f":
            return f"[{shape}{reals(value)}]"
        return f"[{shape}{several([written(each, depth) for each in value.ravel().tolist()])}]"
    if isinstance(value, Mapping):
        items = (f"{written(key, 2)}: {written(each, depth)}" for key, each in value.items())
        return f"{{{several(list(items))}}}"
    if isinstance(value, type | ModuleType) or (callable(value) and not hasattr(value, "__dataclass_fields__")):
        return getattr(value, "__name__", type(value).__name__)
    if isinstance(value, Enum | NumberFormat) or not type(value).__module__.startswith(("gpbnb", "tests")):
        if hasattr(value, "__iter__") and not isinstance(value, str | bytes):
            listed = sorted(value) if isinstance(value, set | frozenset) else list(value)
            if listed and all(isinstance(each, float) for each in listed):
                return f"[{several([real(each) for each in listed])}]"
            return f"[{several([written(each, depth) for each in listed])}]"
        return several([re.sub(r"-?\d+/\d{12,}", lambda ratio: real(float(Fraction(ratio[0]))), str(value))])
    if depth > 1:
        return type(value).__name__
    return f"{type(value).__name__}({several([f'{n}={written(each, depth + 1)}' for n, each in attributes(value)])})"


def text(call, stored, space):
    """What is stored of a call: its refusal, or what it returns, as written, or at a prompt and as print shows it."""
    try:
        found = eval(call, space)
        said = written(found) if stored == "answers" else ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    if said:
        return "\n".join(textwrap.wrap(said, 116, break_long_words=False, break_on_hyphens=False))
    both = [found.rstrip("\n")] if isinstance(found, str) else [repr(found), str(found)]
    return "\n".join(line.rstrip() for each in dict.fromkeys(both) for line in each.splitlines())


def agrees(found, stored):
    """Of a stored text that ends in …, only what comes before it is compared."""
    return found.startswith(stored[:-1]) if stored.endswith("…") else found == stored


CALLS = [(stored, section) for stored in STORED for section in texts(stored)]
LEDGER = "shown", "true values of the ledger"
"""Computed in the process that judges them, in tests/ledger/test_verdicts.py."""


# Sections of the command, of searches and of guarantees take up to 5 s, as they answer dozens of whole questions.
@pytest.mark.parametrize(("stored", "section"), [each for each in CALLS if each != LEDGER])
def test_a_call_gives_what_is_stored(stored, section):
    assert_stored(stored, section)


def assert_stored(stored, section):
    space = names(section)
    with folder(stored):
        for call, answer in texts(stored)[section]:
            found = text(call, stored, space)
            assert agrees(found, answer), call


def renewed(stored, section, calls):
    space = names(section)
    yield f"# {section}"
    for call, answer in calls:
        found = text(call, stored, space)
        kept = answer if answer and agrees(found, answer) else found
        yield f"{call}\n{textwrap.indent(kept, '    ')}"


if __name__ == "__main__":
    warnings.simplefilter("error")
    for stored in [each for each in STORED if each in sys.argv[1:2] or len(sys.argv) == 1]:
        parts = []
        for section, calls in texts(stored).items():
            if all(word in section for word in sys.argv[2:]):
                with folder(stored):
                    parts.append("\n".join(renewed(stored, section, calls)))
            else:
                parts.append(
                    "\n".join([f"# {section}", *(f"{call}\n{textwrap.indent(kept, '    ')}" for call, kept in calls)])
                )
        STORED[stored].write_text("\n\n".join(parts) + "\n", encoding="utf-8")
