"""Every task for every kind of model: it works, or one sentence names what to use instead."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import signal

from gpbnb import (
    BlockFormats,
    FixedFormat,
    FixedIntervalSmoother,
    FloatFormat,
    LinearModel,
    LinearSystem,
    NonlinearModel,
    NonlinearSystem,
    TracedFunction,
    WordFormats,
    emulate,
    guarantee,
    limit_cycles,
    limits,
    required_precision,
    survey_records,
    write_code,
)
from gpbnb.wordlength.asked import CANNOT, WHY, admitted, kind_of

STEPS = 12
WALK = {"Phi": [["0.9"]], "H": [[1]], "Q": [["0.01"]], "R": [[1]], "x0": [0], "P0": [[1]]}
Z = (np.round(np.sin(0.7 * np.arange(STEPS)) * 64) / 128).tolist()
WORDS = WordFormats(FixedFormat(2, 10), 15)


def moved(x):
    return x * x.format.array("0.9")


def seen(x):
    return x


def step(fmt, x, u):
    after = x + (u - x) * fmt.array("0.125")
    return after, after


def smoothed(fmt, z):
    x, found = fmt.array(0), []
    for value in z:
        x = x + (value - x) * fmt.array("0.125")
        found.append(x)
    return found


def nonlinear(**options):
    rest = (WALK[each] for each in ("Q", "R", "x0", "P0"))
    return NonlinearModel(moved, None, seen, None, *rest, **options)


MODELS = {
    "filter": LinearModel(**WALK),
    "driven": LinearModel(**WALK, B=[[1]], u=[[0.125]] * STEPS),
    "extended": nonlinear(),
    "unscented": nonlinear(method="unscented"),
    "system": LinearSystem([["0.9"]], [["0.1"]]),
    "pid": LinearSystem.pid("0.5", "0.1", leak="0.9", limits=(-1, 1)),
    "step": NonlinearSystem(step, [0]),
    "function": smoothed,
    "traced": TracedFunction(smoothed),
    "smoother": FixedIntervalSmoother(LinearModel(**WALK), [[each] for each in Z]),
    "mapping": WALK,
    "path": "model.toml",
    "scipy": signal.dlti([0.1], [1, -0.9], dt=1),
}
READ = ("mapping", "path", "scipy")
"""What is read as one of the others; a few tasks show that each kind of task reads it."""


def found(model, **options):
    """Whether an answer about the record is met, with a format."""
    answer = required_precision(model, data(model), "1/20", **options)
    assert bool(answer) is answer.met is (answer.ratio <= 1)
    assert answer.digits >= 1
    assert answer.tried
    assert answer.format is not None
    assert str(answer) == repr(answer) != ""
    return answer.met


def data(model):
    return STEPS if isinstance(model, FixedIntervalSmoother) else Z


def limited(model, **options):
    of_filter = kind_of(admitted(model)).startswith("a Kalman")
    within = limits(state=2, innovation=3) if of_filter else limits(measurement=1)
    return found(model, within=within, **options)


def bounded(model, fmt):
    of_filter = kind_of(admitted(model)).startswith("a Kalman")
    given = guarantee(model, fmt, limits(state=2, innovation=3) if of_filter else limits(measurement=1))
    return 0 < given.bound.max() < 1 and given.steps is None


def ran(model, fmt, **options):
    run = emulate(model, data(model), fmt, **options)
    assert run.steps == STEPS
    assert not run.reason
    numbers = run.y if run.x is None else run.x
    return numbers.shape[0] == STEPS and 0 < run.largest.max() < 0.1


def surveyed(model, formats, **options):
    records = [data(model)] * 2
    return survey_records(model, records, 0.1, formats, **options).shares[-1] == 1


def written(model, fmt, tmp_path):
    return all(path.exists() for path in write_code(model, fmt, tmp_path))


TASKS = {
    "emulate": ("", lambda m, _: ran(m, "float32")),
    "emulate in fixed point": ("", lambda m, _: ran(m, "Q5.12")),
    "emulate in words": ("have formats for data, coefficients and sums", lambda m, _: ran(m, WORDS)),
    "emulate in blocks": (
        "have formats for blocks",
        lambda m, _: ran(m, BlockFormats.uniform(FloatFormat(2, 20))),
    ),
    "emulate in a form": ("have a form", lambda m, _: ran(m, "float32", form="Joseph")),
    "search": ("", lambda m, _: found(m)),
    "search in base 10": ("", lambda m, _: found(m, base=10, rounding="chop")),
    "search within a range": ("", lambda m, _: found(m, range=(-14, 15))),
    "search in a form": ("have a form", lambda m, _: found(m, form="UD")),
    "search by the bound": ("be bounded along a run", lambda m, _: found(m, basis="bound")),
    "search by a guarantee": ("have a guarantee", lambda m, _: limited(m, basis="guarantee")),
    "search by the probable error": ("have a probable error", lambda m, _: limited(m, basis="probable")),
    "search fraction bits": ("", lambda m, _: found(m, kind="fixed")),
    "search fraction bits like a format": ("", lambda m, _: found(m, kind="fixed", like="Q5.2")),
    "search fraction bits by a guarantee": (
        ("have a guarantee", "have a guarantee in fixed-point words"),
        lambda m, _: limited(m, kind="fixed", basis="guarantee"),
    ),
    "search words": ("have formats for data, coefficients and sums", lambda m, _: found(m, kind="words")),
    "search blocks": ("have formats for blocks", lambda m, _: found(m, kind="blocks")),
    "survey": ("", lambda m, _: surveyed(m, ["bfloat16", "float32"])),
    "survey in fixed point": ("", lambda m, _: surveyed(m, ["Q5.12"])),
    "survey bounds": ("be bounded along a run", lambda m, _: surveyed(m, ["float32"], basis="bound")),
    "guarantee": ("have a guarantee", lambda m, _: bounded(m, "float32")),
    "guarantee in fixed point": ("have a guarantee", lambda m, _: bounded(m, "Q5.20")),
    "limit cycles": (
        "be searched for limit cycles",
        lambda m, _: limit_cycles(m, WordFormats(FixedFormat(4, 6))).cycles,
    ),
    "code": ("be written in C", lambda m, path: written(m, "float32", path)),
    "code in fixed point": ("be written in C", lambda m, path: written(m, "Q5.12", path)),
    "pickle": ("", lambda m, _: pickle.loads(pickle.dumps(m)) is not None),
}
"""Each task, with what a kind of model may be unable to do."""

FURTHER = {
    ("emulate in blocks", "unscented"): "formats of blocks for an unscented filter; needed the innovation form",
    ("emulate in a form", "unscented"): "for an unscented filter; needed the innovation form",
    ("search in a form", "unscented"): "for an unscented filter; needed the innovation form",
    ("search blocks", "unscented"): "formats of blocks for an unscented filter; needed the innovation form",
}
"""Refusals that do not follow from the kind alone."""


FEW = ("emulate", "search", "survey", "guarantee", "code")
CELLS = [(task, name) for task in TASKS for name in MODELS if name not in READ or task in FEW]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text("".join(f"{key} = {value}\n".replace("'", '"') for key, value in WALK.items()))


@pytest.mark.parametrize("task", TASKS)
def test_a_task_works_or_names_its_way(task, tmp_path):
    ways, does = TASKS[task]
    for name in (name for each, name in CELLS if each == task):
        model = MODELS[name]
        kind = kind_of(admitted(model))
        needs = next((each for each in ([ways] if isinstance(ways, str) else ways) if kind in CANNOT.get(each, ())), "")
        if needs:
            why = WHY.get(needs, {}).get(kind, "")
            with pytest.raises(ValueError, match=rf"{kind},? cannot {needs}{why and f', {why}'}; ") as refused:
                does(model, tmp_path / name)
            assert str(refused.value).endswith(CANNOT[needs][kind]), name
        elif (task, name) in FURTHER:
            with pytest.raises(ValueError, match=FURTHER[task, name]):
                does(model, tmp_path / name)
        else:
            assert does(model, tmp_path / name), name
