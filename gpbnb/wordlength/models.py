"""Read a model from a TOML file or from an object of SciPy, python-control or FilterPy, without importing these."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.model import LinearModel
from gpbnb.sweeps import plain_number
from gpbnb.wordlength.system import LinearSystem

KALMAN = ("Phi", "H", "Q", "R", "x0", "P0")
"""Keys of a Kalman filter in a TOML file."""

INPUTS = ("B", "u", "b", "d", "steps")
"""Further keys of a Kalman filter, for known inputs and offsets; see :class:`gpbnb.filters.model.LinearModel`."""

SYSTEM = ("A", "B")
"""Keys of a linear system in a TOML file; ``C``, ``D`` and ``x0`` are optional. Each model may have a ``name``."""


FILTERS = ("KalmanFilter", "SquareRootKalmanFilter", "FadingKalmanFilter")
"""Classes of FilterPy that are read; their estimates after ``predict()`` and ``update(z)`` are those of the model."""

SYSTEMS = {"scipy": ("StateSpace", "TransferFunction", "ZerosPolesGain"), "control": ("StateSpace", "TransferFunction")}
"""Classes of ``scipy.signal`` and python-control that are read."""


def read_model(source: Any, u: Any = None) -> LinearModel | LinearSystem:
    """Read a model from a TOML file, a mapping of its matrices, or an object of another library.

    The answer for an object holds for its estimates or outputs. Whatever else it holds that changes them is refused. Of
    a class derived from one of these, nobody knows what it computes, so it is refused as well.

    Parameters
    ----------
    source : a path to a TOML file with :data:`KALMAN` or :data:`SYSTEM`; a mapping with the same keys; a discrete
        system of ``scipy.signal`` or python-control, one of :data:`SYSTEMS`, read as a linear system from rest; or a
        filter of FilterPy, one of :data:`FILTERS`, whose current estimate becomes the initial one. A step is then
        ``predict()`` or ``predict(u)``, and ``update(z)``, without other arguments.
    u : known inputs of a Kalman filter, (steps, p), in place of those in `source`, which must have B.

    Raises
    ------
    ValueError : a key is missing or unknown; a system is continuous, or has no time step; a filter of FilterPy has a
        fading memory ``alpha``, correlated noise ``M``, another inverse ``inv``, inputs ``B`` without `u`, or other
        changes; or the class of the model rejects a matrix.
    TypeError : an object of another class.
    OSError : the file cannot be read.

    Examples
    --------
    >>> model = read_model({"A": [["0.5"]], "B": [[1]], "name": "halves"})
    >>> model.name, model.n
    ('halves', 1)
    """
    if isinstance(source, (str, Path)):
        return _from_toml(Path(source), u)
    if isinstance(source, Mapping):
        return _from_mapping(source, "the mapping", u)
    library, kind = type(source).__module__.partition(".")[0], type(source).__name__
    if library == "filterpy" and kind in FILTERS:
        return _from_filterpy(source, u)
    if u is not None:
        raise ValueError(f"got inputs for a {kind}; needed a TOML file, a mapping or a filter of FilterPy with B")
    if isinstance(source, (LinearModel, LinearSystem)):
        return source
    if kind.removesuffix("Continuous").removesuffix("Discrete") in SYSTEMS.get(library, ()):
        return _from_system(source, library)
    raise TypeError(
        f"got a {kind}; needed the path of a TOML file, a mapping, a discrete {', '.join(SYSTEMS['scipy'])} of "
        f"scipy.signal or python-control, or a {', '.join(FILTERS)} of FilterPy; write the matrices of another class, "
        f"or of one derived from these, as a mapping with the keys {', '.join(KALMAN)}, or {', '.join(SYSTEM)}"
    )


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


def _from_toml(path: Path, u: Any) -> LinearModel | LinearSystem:
    content = path.read_bytes()
    try:
        found = tomllib.loads(content.decode("utf-8-sig"), parse_float=Decimal)
    except ValueError as error:  # also text that is not UTF-8, and an integer too long for Python
        raise ValueError(f"{path.name} is not TOML: {error}") from None
    except ArithmeticError:
        raise ValueError(f"{path.name}: got an exponent that is too long; needed numbers such as 1e-3") from None
    except RecursionError:
        raise ValueError(f"{path.name} is not TOML: its lists are nested too deeply") from None
    return _from_mapping(found, path.name, u)


def _from_mapping(given: Mapping[str, Any], where: str, u: Any) -> LinearModel | LinearSystem:
    kalman = any(key in given for key in ("Phi", "H", "Q", "R", "P0"))
    if u is not None:
        if not kalman:
            raise ValueError(
                f"{where}: got known inputs for a linear system; needed none: its measurements are its inputs"
            )
        given = {**given, "u": u}
    needed = KALMAN if kalman else SYSTEM
    allowed = {*needed, *INPUTS, "name", "repair"} if kalman else {*needed, "C", "D", "x0", "name"}
    missing, unknown = [key for key in needed if key not in given], sorted(map(str, set(given) - allowed))
    if missing or unknown:
        problems = [f"{', '.join(missing)} missing"] if missing else []
        problems += [f"{', '.join(unknown)} unknown"] if unknown else []
        raise ValueError(
            f"{where}: {'; '.join(problems)}; needed {', '.join(KALMAN)} for a Kalman filter, or "
            f"{', '.join(SYSTEM)} and optionally C, D, x0 for a linear system"
        )
    arguments: dict[str, Any] = {"repair": True} if kalman else {}
    arguments |= {"name": where.removesuffix(".toml")} | dict(given)
    if not isinstance(arguments["name"], str):
        raise ValueError(f"{where}: got name {arguments['name']!r}; needed text")
    try:
        return LinearModel(**arguments) if kalman else LinearSystem(**arguments)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: {error}") from None


def read_measurements(path: str | Path) -> NDArray[np.float64]:
    """Read measurements (steps, m) from a CSV file with a row for each step and a column for each measurement.

    Lines of text before the first numbers are headers. An empty cell or ``nan`` is a missing measurement.

    Raises
    ------
    ValueError : a cell is not a number, or rows differ in length; the message has file and line.
    OSError : the file cannot be read.
    """
    path, rows = Path(path), list[list[float]]()
    with path.open(encoding="utf-8-sig", newline="") as stream:
        reader = csv.reader(stream)
        try:
            for cells in reader:
                if not cells or cells[0].startswith("#"):
                    continue
                try:
                    row = [plain_number(cell.strip()) if cell.strip() else np.nan for cell in cells]
                except ValueError:
                    if not rows and all(cell.strip()[:1].isalpha() for cell in cells):
                        continue  # a header
                    raise
                if rows and len(row) != len(rows[0]):
                    raise ValueError(f"got {len(row)} cells; needed {len(rows[0])}, as in the rows above")
                rows.append(row)
        except UnicodeDecodeError as error:
            raise ValueError(f"{path.name} is not UTF-8: {error}") from None
        except (ValueError, csv.Error) as error:
            raise ValueError(f"{path.name}, line {reader.line_num}: {error}") from None
    if not rows:
        raise ValueError(f"{path.name}: got no rows of numbers; needed one for each step")
    return np.array(rows)
