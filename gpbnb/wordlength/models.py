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

from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.system import LinearSystem
from gpbnb.sweeps import plain_number

KALMAN = ("Phi", "H", "Q", "R", "x0", "P0")
"""Keys of a Kalman filter in a TOML file."""

INPUTS = ("B", "u", "b", "d", "steps")
"""Further keys of a Kalman filter, for known inputs and offsets; see :class:`gpbnb.kalman.model.LinearModel`."""

SYSTEM = ("A", "B")
"""Keys of a linear system in a TOML file; ``C``, ``D`` and ``x0`` are optional. Each model may have a ``name``."""


def read_model(source: Any, u: Any = None) -> LinearModel | LinearSystem:
    """Read a model from a TOML file, a mapping of its matrices, or an object of another library.

    Parameters
    ----------
    source : a path to a TOML file with :data:`KALMAN` or :data:`SYSTEM`; a mapping with the same keys; a discrete
        ``scipy.signal.dlti``, ``scipy.signal.StateSpace`` or ``control.StateSpace``, read as a linear system; a
        ``filterpy`` Kalman filter (``F, H, Q, R, x, P``), whose current estimate becomes the initial one.
    u : known inputs of a Kalman filter, (steps, p), in place of those in `source`, which must have B.

    Raises
    ------
    ValueError : a key is missing or unknown; a system is continuous; or the class of the model rejects a matrix.
    TypeError : an object of another kind.
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
    if u is not None:
        raise ValueError(f"got inputs for a {type(source).__name__}; needed a TOML file or a mapping with B")
    if isinstance(source, (LinearModel, LinearSystem)):
        return source
    if all(hasattr(source, letter) for letter in ("F", "H", "Q", "R", "x", "P")):
        x = np.asarray(source.x, dtype=np.float64).reshape(-1)
        name = type(source).__name__
        return LinearModel(source.F, np.atleast_2d(source.H), source.Q, np.atleast_2d(source.R), x, source.P, name)
    if not hasattr(source, "A") and hasattr(source, "to_ss"):
        source = source.to_ss()
    if all(hasattr(source, letter) for letter in ("A", "B", "C", "D")):
        if not getattr(source, "dt", None):
            raise ValueError(
                f"got a {type(source).__name__} without a time step, so a continuous system; needed a "
                "discrete system; discretize it first, for example with its to_discrete(dt) or "
                "scipy.signal.cont2discrete"
            )
        A, B, C, D = (np.asarray(getattr(source, letter), dtype=np.float64) for letter in ("A", "B", "C", "D"))
        return LinearSystem(A, B, C, D, name=type(source).__name__)
    raise TypeError(
        f"got a {type(source).__name__}; needed the path of a TOML file, a mapping, a discrete state-space system, or "
        "a Kalman filter with F, H, Q, R, x and P"
    )


def _from_toml(path: Path, u: Any) -> LinearModel | LinearSystem:
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"), parse_float=Decimal)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name} is not TOML: {error}") from None
    return _from_mapping(found, path.name, u)


def _from_mapping(given: Mapping[str, Any], where: str, u: Any) -> LinearModel | LinearSystem:
    if u is not None:
        given = {**given, "u": u}
    kalman = any(key in given for key in ("Phi", "H", "Q", "R", "P0"))
    needed = KALMAN if kalman else SYSTEM
    allowed = {*needed, *INPUTS, "name", "repair"} if kalman else {*needed, "C", "D", "x0", "name"}
    missing, unknown = [key for key in needed if key not in given], sorted(set(given) - allowed)
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
        for cells in reader:
            if not cells or cells[0].startswith("#"):
                continue
            try:
                row = [plain_number(cell.strip()) if cell.strip() else np.nan for cell in cells]
            except ValueError as error:
                if not rows and all(cell.strip()[:1].isalpha() for cell in cells):
                    continue  # a header
                raise ValueError(f"{path.name}, line {reader.line_num}: {error}") from None
            if rows and len(row) != len(rows[0]):
                raise ValueError(
                    f"{path.name}, line {reader.line_num}: got {len(row)} cells; needed {len(rows[0])}, as in the rows "
                    "above"
                )
            rows.append(row)
    if not rows:
        raise ValueError(f"{path.name}: got no rows of numbers; needed one for each step")
    return np.array(rows)
