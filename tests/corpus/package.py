"""Everything that the corpus asks of the package: if an interface changes, it changes here.

A run is an iterator of steps. A step is a dict of named numbers, nested lists of Fractions, or of text that says how a
run ended. :mod:`tests.corpus.oracle` has functions of the same names that share no code with the package.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb import (
    BlockFormats,
    FixedFormat,
    FixedIntervalSmoother,
    FloatFormat,
    LinearModel,
    LinearSystem,
    NonlinearModel,
    NonlinearSystem,
    WordFormats,
    guarantee,
    limits,
    linalg,
    required_precision,
    survey_records,
    write_code,
)
from gpbnb.filters.forms import form_named
from gpbnb.filters.nonlinear_run import opened
from gpbnb.filters.run import LEFT_TO_RIGHT, Run, Sums
from tests.corpus.draw import Fixed, Float, Format, Model
from tests.plain_steps import Coasting, Moving, Ranges, Turning
from tests.plain_steps import drawn as random_step
from tests.step_functions import SYSTEMS

Steps = Iterator[dict[str, Any]]

STOPS = (OverflowError, ZeroDivisionError, ValueError, np.linalg.LinAlgError)
"""Errors by which an operation or a run may end."""


def fmt_of(given: Format) -> Any:
    """The package's format."""
    if isinstance(given, Fixed):
        return FixedFormat(*given)
    base, precision, rounding, emin, emax, subnormal, overflow, largest = given
    return FloatFormat(base, precision, rounding, emin, emax, subnormal, largest, overflow=overflow)


def ended(error: Exception) -> str:
    """How an operation ended: the kind of an error."""
    kinds = {np.linalg.LinAlgError: "singular", OverflowError: "overflow", ZeroDivisionError: "division by zero"}
    return next((text for kind, text in kinds.items() if isinstance(error, kind)), "refused")


def model_of(given: Model) -> LinearModel:
    return LinearModel(*given[:6], **given.inputs)


# -- filters ----------------------------------------------------------------------------------------------------------


def filtered(model: Model, z: Any, fmt: Format, form: str, **options: Any) -> Steps:
    """A Kalman filter: estimate, gain and covariance after each step, then how it ended.

    Options are `blocks`, formats by block, and `sums`, as (order, fused, block, format).
    """
    chosen: Any = fmt_of(fmt)
    sums = LEFT_TO_RIGHT
    if blocks := options.get("blocks"):
        chosen = BlockFormats(**{name: fmt_of(each) for name, each in blocks.items()})
    if given := options.get("sums"):
        order, fused, block, wider = given
        sums = Sums(fused, None if wider is None else fmt_of(wider), order, block)
    given_model = model_of(model)
    yield from _run(given_model, z, chosen, form, sums)


def as_functions(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    """The same filter, without cycles of Phi and H, as functions of the state, which run in any format."""
    yield from _run(
        NonlinearModel(*_linear(model.Phi[0]), *_linear(model.H[0]), *model[2:6]), z, fmt_of(fmt), form, LEFT_TO_RIGHT
    )


def _linear(matrix: Any) -> tuple[Any, Any]:
    return lambda x: x.format.array(matrix) @ x, lambda x: x.format.array(matrix)


def _run(model: Any, z: Any, fmt: Any, form: str, sums: Any) -> Steps:
    try:
        asked = model, fmt, form_named(form), range(1, len(z) + 1)
        run = opened(*asked) if sums == LEFT_TO_RIGHT else Run(*asked, sums)
        run.take(np.array(z, dtype=object))
    except STOPS as error:
        yield {"end": ended(error)}
        return
    saved = run.checkpoints()
    for x, K, P in zip(saved.x, saved.K, saved.P, strict=True):
        yield {"x": x.tolist(), "K": K.tolist(), "P": P.tolist()}
    yield {"end": run.reason.split(";")[0], "indefinite": str(run.indefinite)}


def recorded(model: Model, records: Any, fmt: Format, form: str) -> Steps:
    """Estimates of many records at once, to the nearest float64, after each step."""
    run = Run(model_of(model), fmt_of(fmt), form_named(form), (), records=len(records))
    z = np.moveaxis(np.array([[[float(each) for each in row] for row in record] for record in records]), 0, 2)
    for x in run.carry(z, model.n):
        yield {"x": [[str(each) for each in row] for row in x.tolist()]}


MOTIONS = {"moving": Moving(), "turning": Turning(), "coasting": Coasting()}


def tracked(motion: str, given: Any, z: Any, u: Any, fmt: Format, form: str, **options: Any) -> Steps:
    """An extended or unscented filter of a vehicle that measures range and bearing of a beacon."""
    Q, R, x0, P0 = given
    sight, blocks = Ranges(["0.3", "0.2"]), options.pop("blocks", None)
    functions = (MOTIONS[motion].emulated, None, sight.emulated, None)
    model = NonlinearModel(*functions, Q, R, x0, P0, u=u, angles=[1], **options)
    chosen = BlockFormats(**{name: fmt_of(each) for name, each in blocks.items()}) if blocks else fmt_of(fmt)
    yield from _run(model, z, chosen, form, LEFT_TO_RIGHT)


def smoothed(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    """Smoothed estimates and covariances, or roots, of each step."""
    try:
        found = FixedIntervalSmoother(model_of(model), z, form).run(fmt_of(fmt))
    except STOPS as error:
        yield {"end": ended(error)}
        return
    for x, P in zip(found.x.to_fractions().tolist(), found.P.to_fractions().tolist(), strict=True):
        yield {"x": x, "P": P}


# -- systems ----------------------------------------------------------------------------------------------------------


def system_of(kind: str, settings: dict[str, Any]) -> LinearSystem:
    """A digital filter in a structure, or a smoother, a controller or a sum."""
    made: LinearSystem = getattr(LinearSystem, kind)(**settings) if kind != "matrices" else LinearSystem(**settings)
    return made


def responded(kind: str, settings: dict[str, Any], u: Any, fmt: Format) -> Steps:
    """States and outputs of a system after each step."""
    system, chosen = system_of(kind, settings), fmt_of(fmt)
    try:
        found = system.states(np.array(u, dtype=object), chosen)
    except STOPS as error:
        yield {"end": ended(error)}
        return
    # Sums of two float64 are exact in base 2 and 16; in base 10, they have many digits more than the format.
    to = FloatFormat(10, chosen.precision).round if chosen.base == 10 else Fraction
    for row in found.tolist():
        values = [to(Fraction(high) + Fraction(low)) for high, low in row]
        yield {"x": values[: system.n], "y": values[system.n :]}


def in_words(kind: str, settings: dict[str, Any], u: Any, data: Fixed, coefficients: Any, sums: Fixed | None) -> Steps:
    """The same on integers, with formats of their own for data, coefficients and sums."""
    system = system_of(kind, settings)
    try:
        found = system.states(np.array(u, dtype=object), words_of(data, coefficients, sums))
    except STOPS as error:
        yield {"end": ended(error)}
        return
    for row in found.tolist():
        values = [Fraction(high) + Fraction(low) for high, low in row]
        yield {"x": values[: system.n], "y": values[system.n :]}


def words_of(data: Fixed, coefficients: Any, sums: Fixed | None) -> WordFormats:
    short = fmt_of(coefficients) if isinstance(coefficients, Fixed) else coefficients
    return WordFormats(fmt_of(data), short, None if sums is None else fmt_of(sums))


def stepped(index: int, u: Any, fmt: Format) -> Steps:
    """States and outputs of a system whose step is a function: one of four, or one of random operations."""
    system = SYSTEMS[index] if index < len(SYSTEMS) else NonlinearSystem(random_step(index)[0], ["0.3", "-0.2", 0], 2)
    try:
        found = system.states(fmt_of(fmt), u)
    except STOPS as error:
        yield {"end": ended(error)}
        return
    for row in found.to_fractions().tolist():
        yield {"x": row}


# -- arrays -----------------------------------------------------------------------------------------------------------

ELEMENTWISE: dict[str, Any] = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "fused": lambda x, y, z: x.multiply_add(y, z),
    "sum": lambda x: x.sum(),
    "cumsum": np.cumsum,
    "prod": lambda x: x.prod(),
    "mean": np.mean,
    "sort": np.sort,
    "square": lambda x: x**2,
    "cube": lambda x: x**3,
}
"""Operations that are no function of NumPy of the same name."""


def applied(fmt: Format, operation: str, operands: Any) -> list[Fraction] | str:
    """Results of an operation on arrays of a format; the numbers must be in it."""
    chosen = fmt_of(fmt)
    function = ELEMENTWISE.get(operation) or getattr(np, operation)
    try:
        arrays = [chosen.array(list(each)) for each in zip(*operands, strict=True)]
        return np.ravel(function(*arrays).to_fractions()).tolist()  # type: ignore[no-any-return]
    except STOPS as error:
        return ended(error)


def applied_to_floats(fmt: Format, operation: str, *arrays: Any) -> Any:
    """Results of an operation on arrays of float64, as float64; None if one overflows."""
    chosen = fmt_of(fmt)
    function = ELEMENTWISE.get(operation) or getattr(np, operation)
    try:
        return function(*map(chosen.array, arrays)).to_float()
    except OverflowError:
        return None


def converted(fmt: Format, numbers: Any, kind: str) -> list[Any] | str:
    """Numbers rounded into a format, as "fractions", or from "float64", or to the nearest float64, "to float64"."""
    chosen = fmt_of(fmt)
    try:
        if kind == "float64":
            return chosen.array(np.array([float(each) for each in numbers])).to_fractions().tolist()  # type: ignore[no-any-return]
        found = chosen.array(list(numbers))
        return [each.hex() for each in found.to_float()] if kind == "to float64" else found.to_fractions().tolist()
    except STOPS as error:
        return ended(error)


MATRICES: dict[str, Any] = {
    "matmul": linalg.matmul,
    "lu": lambda a, pivot: list(linalg.lu(a, pivot)),
    "inv": linalg.inv,
    "solve": linalg.solve,
    "det": linalg.det,
    "cholesky": linalg.cholesky,
}


def computed(fmt: Format, operation: str, matrices: Any, **options: Any) -> list[Any] | str:
    """A product, factors, an inverse or a solution; numbers are rounded into the format first."""
    chosen = fmt_of(fmt)
    if options.get("sums") is not None:
        options["sums"] = fmt_of(options["sums"])
    try:
        found = MATRICES[operation](*(chosen.array(each) for each in matrices), **options)
    except STOPS as error:
        return ended(error)
    parts = found if isinstance(found, list) else [found]
    return [np.asarray(each.to_fractions() if hasattr(each, "to_fractions") else each).tolist() for each in parts]


# -- code -------------------------------------------------------------------------------------------------------------

SETTINGS = ("gcc -O0", "gcc -O2", "gcc -O1 -fsanitize=undefined -fno-sanitize-recover=all")


def coded(given: tuple[str, Any], fmt: Any, form: str | None, inputs: Any, settings: Any = SETTINGS[1:2]) -> Steps:
    """The test vectors of a filter in C, and whether its compiled test agrees with them.

    `given` is ("model", model), ("steps", index), or kind and settings of a system; `fmt` a format, or three of words.
    """
    kind, what = given
    source = model_of(what) if kind == "model" else SYSTEMS[what] if kind == "steps" else system_of(kind, what)
    chosen = fmt_of(fmt) if isinstance(fmt, Float | Fixed) else words_of(*fmt)
    with tempfile.TemporaryDirectory() as folder:
        try:
            write_code(
                source, chosen, folder, form=form, inputs=np.array([[float(each) for each in row] for row in inputs])
            )
        except STOPS as error:
            yield {"end": ended(error)}
            return
        for line in (Path(folder) / "filter_vectors.txt").read_text().splitlines():
            yield {"vectors": line.split()}
        for setting in settings:
            yield {"C": _compiled(setting, folder)}


def _compiled(setting: str, folder: str) -> str:
    flags = "-std=c99 -Wall -Wextra -pedantic -ffp-contract=off -Werror"
    build = f"{setting} {flags} -o test filter.c test_filter.c -lm"
    for command in (build.split(), ["./test", "filter_vectors.txt"]):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            return f"{command[0]}: {done.stderr or done.stdout}"[:400]
    return "agrees"


# -- answers ----------------------------------------------------------------------------------------------------------


def searched(kind: str, given: tuple[str, Any], z: Any, tolerance: str, **options: Any) -> Steps:
    """What a search tried: digits, and the error over the tolerance; then its answer."""
    kind_of, what = given
    source = model_of(what) if kind_of == "model" else SYSTEMS[what] if kind_of == "steps" else system_of(kind_of, what)
    measured = np.array([[float(each) for each in row] for row in z])
    accepted = Fraction(tolerance)
    if kind == "precision":
        found: Any = required_precision(source, measured, accepted, **options)
    elif kind == "fraction bits":
        found = required_precision(source, measured, accepted, kind="fixed", **options)
    elif kind == "blocks":
        found = required_precision(source, measured, accepted, kind="blocks", **options)
        yield {"formats": str(found.format)}
        return
    else:
        found = required_precision(source, measured, accepted, kind="words", **options)
        yield {"words": str(found.format)}
        return
    for digits, ratio in sorted(found.tried):
        yield {"digits": str(digits), "ratio": ratio}
    yield {"answer": str(found.digits)}


def surveyed(model: Model, records: Any, tolerance: str, formats: Any) -> Steps:
    """Shares of records within a tolerance, and the largest error over it, for each format."""
    z = [[[float(each) for each in row] for row in record] for record in records]
    found = survey_records(model_of(model), z, float(Fraction(tolerance)), [fmt_of(each) for each in formats])
    for share, ratio in zip(found.shares, np.max(found.ratios, axis=0), strict=True):
        yield {"share": str(share), "ratio": float(ratio)}


def guaranteed(model: Model, fmt: Format, measurement: int, form: str) -> Steps:
    """A bound of the errors for every measurement within a limit."""
    source = model_of(model)
    found = guarantee(source, fmt_of(fmt), limits(measurement=measurement), form=form)
    yield {"steps": str(found.steps), "bound": found.bound.tolist()}
