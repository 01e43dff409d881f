"""Functions of the user's own Python files, which a model file names by path; reading such a model runs these files."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

_RUN = dict[str, Path]()
"""Files that were run, by the names of their code."""


def function_at(text: Any, key: str, folder: Path, loaded: dict[Path, ModuleType]) -> Callable[..., Any]:
    """Return the function that an entry such as ``step = "model.py:step"`` names from a folder, or is itself.

    A file that is among those `loaded` for the same model is not run again.
    """
    if callable(text):
        return text
    file, _, name = text.rpartition(":") if isinstance(text, str) else ("", "", "")
    got = f"got {key} = {text!r}"
    if not file or not name.isidentifier():
        raise ValueError(f'{got}; needed a function of a Python file, such as {key} = "model.py:{key}"')
    path = (folder / file).resolve()
    if path not in loaded:
        if not path.is_file():
            raise ValueError(f"{got}, and there is no file {path}; needed a Python file, named from {folder.resolve()}")
        loaded[path] = _run(path, got)
    module = loaded[path]
    if not hasattr(module, name):
        own = [each for each, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        has = f", which has {', '.join(own)}" if own else ", which has none"
        raise ValueError(f"{got}; needed a function of {path.name}{has}")
    if not callable(found := getattr(module, name)):
        raise ValueError(f"{got}, which is a {type(found).__name__}; needed a function")
    return found


def _run(path: Path, got: str) -> ModuleType:
    """Run a file as a module, which may import others of its folder."""
    spec = importlib.util.spec_from_file_location(str(path), path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{got}; needed a file whose name ends in .py")
    module, _RUN[str(path)] = importlib.util.module_from_spec(spec), path
    sys.modules[str(path)] = module  # where dataclasses look for the names of their fields
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise ValueError(f"{got}, but {where_raised(error) or raised(error)}; needed a file that runs") from None
    finally:
        sys.path.remove(str(path.parent))
    return module


def where_raised(error: BaseException) -> str:
    """Say in which line of the user's own files an error was raised, and which; empty if in none."""
    places = [(each.filename, each.lineno) for each in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError):
        places.append((error.filename or "", error.lineno))
    own = [(_RUN[file].name, line) for file, line in places if file in _RUN]
    return f"line {own[-1][1]} of {own[-1][0]} raised {raised(error)}" if own else ""


def raised(error: BaseException) -> str:
    """Return the kind and the text of an error in one line."""
    text = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
