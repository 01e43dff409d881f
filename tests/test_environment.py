"""environment.txt is what `make environment` compiles from pyproject.toml, and nothing else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LOCK = (ROOT / "environment.txt").read_text(encoding="utf-8")

# One entry: the pin, its hashes, and who asked for it.
ENTRY = re.compile(
    r"^(?P<pin>[^\s#].*?) \\\n(?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+(?P<via>(?:    #.*\n)+)", re.MULTILINE
)


def pins() -> dict[str, list[str]]:
    """Versions by name; a package may be pinned once for each of several markers."""
    found: dict[str, list[str]] = {}
    for entry in ENTRY.finditer(LOCK):
        requirement = Requirement(entry["pin"])
        (specifier,) = requirement.specifier
        assert specifier.operator == "=="
        found.setdefault(canonicalize_name(requirement.name), []).append(specifier.version)
    return found


def asked_for() -> dict[str, set[str]]:
    """Names that environment.txt says pyproject.toml asked for, by group; "" is the package itself."""
    found: dict[str, set[str]] = {}
    for entry in ENTRY.finditer(LOCK):
        for group in re.findall(r"gpbnb \(pyproject\.toml(?::([\w-]+))?\)", entry["via"]):
            found.setdefault(group, set()).add(canonicalize_name(Requirement(entry["pin"]).name))
    return found


def requirements() -> dict[str, list[Requirement]]:
    groups = {"": PROJECT["project"]["dependencies"], **PROJECT["dependency-groups"]}
    return {group: [Requirement(text) for text in texts] for group, texts in groups.items()}


def test_every_line_of_the_lock_is_a_pin_with_hashes():
    assert ENTRY.sub("", LOCK) == "".join(line for line in LOCK.splitlines(keepends=True) if line.startswith("#"))
    assert len(pins()) > 50


def test_the_lock_names_no_address():
    assert not re.search(r"://|--index-url|--extra-index-url|--find-links|@ |file:", LOCK)


def test_every_requirement_is_pinned_within_its_range():
    locked = pins()
    for requirement in [r for group in requirements().values() for r in group]:
        versions = locked[canonicalize_name(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in versions), requirement


def test_the_lock_was_compiled_from_these_requirements():
    wanted = {group: {canonicalize_name(r.name) for r in group_} for group, group_ in requirements().items()}
    assert asked_for() == wanted


def test_the_build_backend_is_in_the_lock():
    for requirement in map(Requirement, PROJECT["build-system"]["requires"]):
        assert requirement in requirements()["dev"]


def test_make_compiles_every_group():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert set(re.findall(r"--group (\w+)", makefile)) == set(PROJECT["dependency-groups"])
