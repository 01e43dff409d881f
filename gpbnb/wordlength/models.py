"""Read a model from a file or from an object of SciPy, python-control, FilterPy or OpenCV, without importing these."""

from __future__ import annotations

import csv
import io
import json
import math
import tomllib
import unicodedata
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import Numbers
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.filters.structures import structure_named
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.numbers import plain_number
from gpbnb.wordlength.own_code import function_at

KALMAN = ("Phi", "H", "Q", "R", "x0", "P0")
"""Keys of a Kalman filter in a TOML file."""

INPUTS = ("B", "u", "b", "d", "steps")
"""Further keys of a Kalman filter, for known inputs and offsets; see :class:`gpbnb.filters.model.LinearModel`."""

SYSTEM = ("A", "B")
"""Keys of a linear system in a TOML file; ``C``, ``D`` and ``x0`` are optional. Each model may have a ``name``."""

DESIGN = ("b", "a", "sos", "pairing", "order", "scale", "structure")
"""Keys of a digital filter in a TOML file, with ``b`` or ``sos``; see :class:`gpbnb.filters.design.FilterDesign`."""

LISTS = ("states", "measurements", "inputs", "outputs")
NAMES = {key: f"{key[:-1]}_names" for key in LISTS}
"""Keys that list names in a TOML file, each perhaps with a unit, and the arguments of the models for them."""

PID = ("Kp", "Ki", "Kd", "leak", "limits", "integral_limits", "back_calculation")
"""Keys of a controller in a TOML file; only ``Kp`` and ``Ki`` are needed. See :meth:`gpbnb.LinearSystem.pid`."""

OWN = ("step", "f", "h", "F", "residual", "normalize", "function")
"""Keys of functions, such as ``step = "model.py:step"``; H, too, is a function beside f."""


def _nonlinear_model(F: Any = None, H: Any = None, **rest: Any) -> NonlinearModel:
    return NonlinearModel(F=F, H=H, **rest)


def _function(function: Any, name: str) -> Any:
    return function


_KINDS: dict[str, tuple[Any, Sequence[str], Sequence[str]]] = {
    "a system with a step of its own": (NonlinearSystem, ("step", "x0"), ("m",)),
    "a function": (_function, ("function",), ()),
    "a nonlinear filter": (
        _nonlinear_model,
        ("f", "h", *KALMAN[2:]),
        (*"FHu", "angles", "residual", "normalize", "iterations", "method", "steps", "repair", *LISTS[:2]),
    ),
    "a Kalman filter": (LinearModel, KALMAN, (*INPUTS, "repair", *LISTS[:3])),
    "a linear system": (LinearSystem, SYSTEM, ("C", "D", "x0", "states", "inputs", "outputs")),
    "a digital filter": (FilterDesign, (), (*DESIGN, "inputs", "outputs")),
    "a controller": (LinearSystem.pid, PID[:2], PID[2:]),
}
"""What makes each kind of model in a file, the keys that it needs, and those that it may have beside a name."""

FILTERS = ("KalmanFilter", "SquareRootKalmanFilter", "FadingKalmanFilter")
"""Classes of FilterPy that are read; their estimates after ``predict()`` and ``update(z)`` are those of the model."""

SYSTEMS = {"scipy": ("StateSpace", "TransferFunction", "ZerosPolesGain"), "control": ("StateSpace", "TransferFunction")}
"""Classes of ``scipy.signal`` and python-control that are read."""


ModelSource: TypeAlias = Any
"""What :func:`read_model` takes; also a model of this package, or a function of a format and data."""

MODELS = (LinearModel, LinearSystem, NonlinearModel, NonlinearSystem, FixedIntervalSmoother)
"""Models of this package, which are read as they are."""


def read_model(source: Any, u: Numbers | None = None) -> Any:
    """Read a model from a TOML file, a mapping of its matrices, or an object of another library.

    The model that is read computes the same estimates or outputs as the object of the other library. An object with
    settings that a model cannot express is therefore rejected, and so is an object of a derived class, which may
    compute something else.

    Parameters
    ----------
    source : the path of a TOML, JSON, NPZ or MAT file, or a mapping with the same keys: Phi, H, Q, R, x0 and P0 for a
        Kalman filter; A, B and optionally C, D and x0 for a linear system; b and a, or sos, for a digital filter; Kp
        and Ki for a controller. Lists of names are optional: states, measurements, inputs, outputs. Functions are
        named by the path from the file: step = "model.py:step" and x0 for a :class:`gpbnb.NonlinearSystem`; f, h, Q, R,
        x0 and P0 for a :class:`gpbnb.NonlinearModel`; function for a function of a format and data. Reading such a
        model runs the Python file: read none that you do not trust. Or (b, a), or
        sections (sections, 6). Or a discrete StateSpace or TransferFunction of ``scipy.signal`` or python-control, or a
        ZerosPolesGain of ``scipy.signal``; it is read as a linear system in state space that starts at rest. Or a
        KalmanFilter, SquareRootKalmanFilter or FadingKalmanFilter of FilterPy, or a KalmanFilter of OpenCV; its current
        estimate becomes the first estimate, and a step means ``predict()`` or ``predict(u)``, then ``update(z)`` or
        ``correct(z)``, without other arguments. A model of this package is returned as it is.
    u : (steps, p), known inputs of a Kalman filter, in place of those in `source`; the source must have B.

    Raises
    ------
    ValueError : a key is missing or unknown; a system is continuous, or has no time step; a filter of FilterPy has a
        fading memory ``alpha``, correlated noise ``M``, another inverse ``inv``, inputs ``B`` without `u`, or other
        changed settings; the class of the model rejects a matrix; or a Python file lacks the function, or raises an
        error.
    TypeError : the class of the object is not supported.
    OSError : the file cannot be read.

    Examples
    --------
    >>> model = read_model({"A": [["0.5"]], "B": [[1]], "name": "halves"})
    >>> model.name, model.n
    ('halves', 1)
    """
    if isinstance(source, tuple | list | np.ndarray):
        source = _coefficients(source)
    if isinstance(source, (str, Path, Mapping)):
        return _of_file(source, u)[0]
    library, kind = type(source).__module__.partition(".")[0], type(source).__name__
    if library == "filterpy" and kind in FILTERS:
        return _from_filterpy(source, u)
    if u is not None:
        raise ValueError(f"got inputs for a {kind}; needed a TOML file, a mapping or a filter of FilterPy with B")
    if isinstance(source, MODELS):
        return source
    if library == "cv2" and kind == "KalmanFilter":
        return _from_opencv(source)
    if library in _UPDATE_FIRST:
        raise TypeError(
            f"got a {kind} of {library}, which starts with an update; needed a filter that starts with a prediction: "
            f"copy its matrices into LinearModel(Phi, H, Q, R, x0, P0, steps=...), where Phi is a function of the step "
            "that is the identity for step 0, and Q one that is zero there"
        )
    if kind.removesuffix("Continuous").removesuffix("Discrete") in SYSTEMS.get(library, ()):
        return _from_system(source, library)
    raise TypeError(
        f"got a {kind}; needed the path of a TOML file, a mapping, a discrete {', '.join(SYSTEMS['scipy'])} of "
        f"scipy.signal or python-control, or a {', '.join(FILTERS)} of FilterPy; write the matrices of another class, "
        f"or of one derived from these, as a mapping with the keys {', '.join(KALMAN)}, or {', '.join(SYSTEM)}"
    )


_UPDATE_FIRST = ("statsmodels", "pykalman", "simdkalman")


def _coefficients(source: Any) -> Mapping[str, Any]:
    """Return b and a, or second-order sections, as a mapping."""
    if len(source) == 2 and not isinstance(source, np.ndarray):
        return {"b": source[0], "a": source[1]}
    try:
        shape = np.shape(source)
    except ValueError:
        raise ValueError("got rows of unequal lengths; needed (b, a), or sections of shape (sections, 6)") from None
    if len(shape) == 2 and shape[1] == 6:
        return {"sos": source}
    kind = type(source).__name__
    raise ValueError(f"got a {kind} of shape {shape}; needed (b, a), or sections of shape (sections, 6)")


def _from_opencv(given: Any) -> LinearModel:
    """Read a filter of OpenCV, whose step is ``predict()``, then ``correct(z)``."""
    control = given.controlMatrix
    if control is not None and np.any(control):
        raise ValueError(
            "got a KalmanFilter of OpenCV with a controlMatrix; needed none: write a LinearModel with B and u"
        )
    F, H = given.transitionMatrix, given.measurementMatrix
    Q, R, x, P = given.processNoiseCov, given.measurementNoiseCov, given.statePost, given.errorCovPost
    return LinearModel(F, H, Q, R, np.asarray(x).reshape(-1), P, "KalmanFilter", repair=True)


def _from_filterpy(given: Any, u: Any) -> LinearModel:
    kind, attributes = type(given).__name__, vars(given)
    n, m = given.dim_x, given.dim_z

    def refused(got: str, needed: str) -> ValueError:
        return ValueError(f"got a {kind} with {got}; needed {needed}")

    for name in attributes:
        if callable(getattr(type(given), name, None)):
            raise refused(f"its own {name}", "the method of its class")
    if any(attributes.get(name, 1) != 1 for name in ("_alpha_sq", "alpha_sq")):
        raise refused(
            f"a fading memory, alpha = {given.alpha}",
            "alpha = 1: a LinearModel does not multiply the predicted covariance by alpha²",
        )
    if kind == "KalmanFilter" and np.any(given.M):
        raise refused("a correlation M of process and measurement noise", "M = 0: a LinearModel has independent noises")
    if attributes.get("inv", np.linalg.inv) is not np.linalg.inv:
        raise refused(f"inv = {getattr(given.inv, '__name__', given.inv)}", "numpy.linalg.inv, the inverse of S")
    for name in ("_I", "I"):
        if name in attributes and not np.array_equal(attributes[name], np.eye(n)):
            raise refused(f"another matrix than the identity in {name}", "the identity")
    matrices: dict[str, Any] = {}
    for letter, shape in {"F": (n, n), "H": (m, n), "Q": (n, n), "R": (m, m), "P": (n, n)}.items():
        entries = np.asarray(getattr(given, letter))
        if entries.shape != shape and not (shape == (1, 1) and not entries.ndim):
            raise refused(f"{letter} of shape {entries.shape}", f"{shape}, as dim_x is {n} and dim_z {m}")
        matrices[letter] = entries.reshape(shape)
    x = np.asarray(given.x)
    if x.shape not in ((n,), (n, 1)) and not (n == 1 and not x.ndim):
        raise refused(f"x of shape {x.shape}", f"({n},) or ({n}, 1)")
    B = None if given.B is None or not np.any(given.B) else np.asarray(given.B)
    if B is not None and u is None:
        raise refused("inputs B", "u=, of shape (steps, p), as for predict(u); without inputs, set its B to None")
    if B is None and u is not None:
        raise refused("u= and no inputs B, or B = 0", f"B of shape ({n}, p), or no u")
    if B is not None and B.ndim != 2:
        raise refused(f"B of shape {B.shape}", f"({n}, p)")
    F, H, Q, R, P = matrices.values()
    return LinearModel(F, H, Q, R, x.reshape(-1), P, kind, B=B, u=u)


class FilterSource(NamedTuple):
    """A filter as a file or a mapping gives it.

    Parameters
    ----------
    model : the model; a digital filter in the structure that the source names, or else in its usual one.
    structures : a digital filter in several structures by name, beginning with the one that the source names; the
        others are those in :data:`gpbnb.filters.design.SIDE_BY_SIDE` or, with ``structure = "all"``, all that the
        filter has. Empty for another model.
    lacking : structures that the filter does not have, by name, each with the reason.
    compares_all : whether the source has ``structure = "all"``, so that none of its structures is the given one.
    design : a digital filter before it has a structure; None for another model.
    """

    model: Any
    structures: Mapping[str, LinearSystem] = MappingProxyType({})
    lacking: Mapping[str, str] = MappingProxyType({})
    compares_all: bool = False
    design: FilterDesign | None = None


def read_filter(source: str | Path | Mapping[str, Any], u: Numbers | None = None) -> FilterSource:
    """Read a model as :func:`read_model` does, and a digital filter in several structures."""
    model, design, named = _of_file(source, u)
    if design is None:
        return FilterSource(model)
    if named == "all":
        return FilterSource(model, *design.compared("all"), True, design)
    first, (others, lacking) = structure_named(design.usual if named is None else named), design.compared()
    structures = {first: model} | {name: each for name, each in others.items() if name != first}
    return FilterSource(model, structures, lacking, design=design)


def _of_file(source: Any, u: Any) -> tuple[Any, FilterDesign | None, Any]:
    """Return a model and, of a digital filter, its design and the structure that the file names, perhaps "all"."""
    if isinstance(source, Mapping):
        given, where, folder = source, "the mapping", Path()
    else:
        path = Path(source)
        given, where, folder = _READERS.get(path.suffix.lower(), _toml)(path), path.name, path.parent
    kind, arguments = _arguments(given, where, u)
    named = arguments.pop("structure", None)
    try:
        loaded = dict[Path, ModuleType]()
        of_functions = (*OWN, "H") if kind == "a nonlinear filter" else OWN
        for key in arguments.keys() & {*of_functions}:
            arguments[key] = function_at(arguments[key], key, folder, loaded)
        made = _KINDS[kind][0](**arguments)
        if isinstance(made, FilterDesign):
            return made.system(None if named == "all" else named), made, named
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from None
    return made, None, named


def _npz(path: Path) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as found:
        return {key: found[key] for key in found.files}


def _mat(path: Path) -> dict[str, Any]:
    try:
        from scipy import io as matlab
    except ImportError:
        raise ValueError(
            f"{path.name}: a MAT file needs SciPy: install it, or save the matrices as NPZ or JSON"
        ) from None
    found = {key: value for key, value in matlab.loadmat(path).items() if not key.startswith("__")}
    rows = {key: np.ravel(value) for key, value in found.items() if key in ("b", "a", "x0")}
    scalars = {key: value.item() for key, value in found.items() if key in PID and value.size == 1}
    return found | rows | scalars


def _json(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(_text(path), parse_float=Decimal)
    except ValueError as error:
        raise ValueError(f"{path.name} is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{path.name}: got a {type(found).__name__}; needed an object with {_KEYS}")
    return found


def _from_system(given: Any, library: str) -> LinearSystem:
    kind, dt = type(given).__name__, given.dt
    if (dt is None) if library == "scipy" else (dt == 0):
        raise ValueError(
            f"got a {kind} without a time step, so a continuous system; needed a discrete system; discretize it first, "
            "for example with scipy.signal.cont2discrete, its to_discrete(dt) or its sample(dt)"
        )
    if dt is None or not 0 < dt < np.inf:
        raise ValueError(f"got a {kind} with dt = {dt}; needed a discrete system; set dt to its time step, or to True")
    try:
        system = given if hasattr(given, "A") else given.to_ss()
    except (NotImplementedError, ImportError, ValueError) as error:
        raise ValueError(
            f"got a {kind} without a state-space form: {error}; needed one that {library} can convert, or a StateSpace"
        ) from None
    name = given.name if library == "control" else kind
    return LinearSystem(system.A, system.B, system.C, system.D, name=name)


_KEYS = (
    f"{', '.join(KALMAN)}, or {', '.join(SYSTEM)}, or b and a, or sos, or Kp and Ki, or step and x0, or f, h, "
    f"{', '.join(KALMAN[2:])}, or function"
)
_READERS = {".npz": _npz, ".mat": _mat, ".json": _json}
"""How files of other tools are read; all others are TOML."""

MOST_BYTES = 2**28
"""Largest size of a file that is read; a device may have no end."""


def _text(path: Path) -> str:
    """Read a file in UTF-8, with or without a byte-order mark."""
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f"{path.name}: got more than {MOST_BYTES:,} bytes; needed a shorter file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ValueError(
            f"{path.name}, line {line}: got the byte {content[error.start]:#04x}, which is not UTF-8; needed a file in "
            "UTF-8; save it in this encoding"
        ) from None


def _toml(path: Path) -> dict[str, Any]:
    text = _text(path)
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except ValueError as error:  # also an integer too long for Python
        raise ValueError(
            f"{path.name} is not TOML: {error}; needed a TOML file with {_KEYS}; NPZ, MAT and JSON files with these "
            "names are read, too"
        ) from None
    except ArithmeticError:
        raise ValueError(f"{path.name}: got an exponent that is too long; needed numbers such as 1e-3") from None
    except RecursionError:
        raise ValueError(f"{path.name} is not TOML: its lists are nested too deeply") from None


def _arguments(given: Mapping[str, Any], where: str, u: Any) -> tuple[str, dict[str, Any]]:
    """Return what kind of model the keys describe, and the arguments that make it; `u` are its known inputs."""
    own = (kind for kind, (_, needed, _) in _KINDS.items() if needed and needed[0] in OWN and needed[0] in given)
    if kind := next(own, ""):
        pass
    elif any(key in given for key in ("Phi", "H", "Q", "R", "P0")):
        kind = "a Kalman filter"
    elif "sos" in given or ("b" in given and not any(key in given for key in (*KALMAN, *SYSTEM))):
        kind = "a digital filter"
    else:
        kind = "a controller" if "Kp" in given else "a linear system"
    _, needed, optional = _KINDS[kind]
    if u is not None:
        if "u" not in optional:
            raise ValueError(f"{where}: got known inputs for {kind}; needed none: its measurements are its inputs")
        given = {**given, "u": u}
    missing = [key for key in needed if key not in given]
    unknown = sorted(map(str, set(given) - {*needed, *optional, "name"}))
    if missing or unknown:
        problems = [f"{', '.join(keys)} {what}" for keys, what in ((missing, "missing"), (unknown, "unknown")) if keys]
        more = f"; or, for another model, {_KEYS}" if kind == "a linear system" else ""
        must = ", ".join(needed) or "b and a, or sos,"
        perhaps = ", ".join(each for each in (*optional, "name") if each not in ("b", "a", "sos"))
        raise ValueError(f"{where}: {'; '.join(problems)}; needed {must} and perhaps {perhaps} for {kind}{more}")
    arguments = ({"repair": True} if "repair" in optional else {}) | {"name": where.removesuffix(".toml")}
    arguments |= {NAMES.get(key, key): value for key, value in given.items()}
    if not isinstance(arguments["name"], str):
        raise ValueError(f"{where}: got name {arguments['name']!r}; needed text")
    return kind, arguments


def read_measurements(path: str | Path) -> NDArray[np.float64]:
    """Read measurements (steps, m) from a CSV file with a row for each step and a column for each measurement.

    Lines of text before the first numbers are headers, such as ``tilt (°)``. An empty cell or ``nan`` is a missing
    measurement. In a file with one column, a blank line between rows of numbers is an empty cell, too; blank lines
    before the first number and after the last row are ignored, as are all those in a file with more columns.

    Raises
    ------
    ValueError : a cell is not a number, rows differ in length, every cell of a column is empty, or the file is not in
        UTF-8; the message has file and line.
    OSError : the file cannot be read.
    """
    path, rows, first, begin, blank = Path(path), list[list[float]](), list[str](), 0, 0
    written = set[int]()  # columns in which a cell is not empty
    reader = csv.reader(io.StringIO(_text(path), newline=""))
    try:
        for cells in ([cell.strip() for cell in each] for each in reader):
            if not cells:
                blank += 1
                continue
            if cells[0].startswith("#"):
                continue
            _check_separator(cells)
            if not rows and _is_header(cells):
                continue
            row = [_number(cell) for cell in cells]
            if not rows:
                first, begin, blank = cells, reader.line_num, 0
            elif len(cells) != len(first):
                cure = "" if max(cells, first, key=len)[-1] else "; remove the comma at the end of the longer row"
                raise ValueError(f"got {len(cells)} cells; needed {len(first)}, as in the rows above{cure}")
            if len(first) == 1:
                rows += [[math.nan]] * blank
            rows.append(row)
            blank = 0
            written |= {i for i, cell in enumerate(cells) if cell}
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path.name}, line {reader.line_num}: {error}") from None
    if not rows:
        raise ValueError(f"{path.name}: got no rows of numbers; needed one for each step")
    for i in range(len(first)):
        if i not in written:
            cure = "remove the comma at the end of each row, or " if 0 < i == len(first) - 1 else ""
            raise ValueError(
                f"{path.name}, line {begin}: got an empty cell in column {i + 1} of this row and every other; needed "
                f"numbers; {cure}write nan where a measurement is missing"
            )
    return np.array(rows)


def _check_separator(cells: list[str]) -> None:
    """Reject a row that another character than a comma separates; decimal commas may split it as well."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if any(separator in cell for cell in cells) and (len(cells) == 1 or not _is_header(cells)):
            raise ValueError(
                f"got {name} between the cells; needed commas, and a point as decimal mark; replace them, or "
                "export with commas"
            )


def _is_header(cells: list[str]) -> bool:
    """Whether a row names its columns: no cell begins as a number does, and one is not a word for a missing number."""
    named = [cell.lower() for cell in cells if cell]
    if any(_begins_as_number(cell) or cell in _WORDS for cell in named):
        return False
    return any(cell not in _MISSING for cell in named)


def _begins_as_number(cell: str) -> bool:
    """Whether a cell begins with a sign, a dash or a point of any script, or has a digit before its first letter."""
    first = next((c for c in cell if c.isalnum()), "")
    return first.isnumeric() or cell[0] in "+.\N{MINUS SIGN}" or unicodedata.category(cell[0]) == "Pd"


_WORDS = ("nan", "inf")
_MISSING = ("n/a", "na", "#n/a", "none", "null", "nil", "missing")


def _number(cell: str) -> float:
    word = cell.lower()
    try:
        return plain_number(word if word in _WORDS else cell) if cell else math.nan
    except ValueError as error:
        cure = "; write nan, or leave the cell empty, where a measurement is missing" if word in _MISSING else ""
        raise ValueError(f"{error}{cure}") from None
