"""Each list of pinned packages is what `make environment` compiles from pyproject.toml, and nothing else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import gpbnb

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# Each file that pins, and the groups of requirements that it pins; "" is the package itself.
LOCKS = {
    "environment.txt": {"", "book", "test"},
    "environment-dev.txt": {"dev"},
    "environment-pages.txt": {"pages"},
    "environment-bench.txt": {"bench"},
}

every_lock = pytest.mark.parametrize("name", LOCKS)

# One entry: the pin, its hashes, and who asked for it.
ENTRY = re.compile(
    r"^(?P<pin>[^\s#].*?) \\\n(?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+(?P<via>(?:    #.*\n)+)", re.MULTILINE
)


def lock(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def pins(name: str) -> dict[str, list[str]]:
    """Versions by name; a package may be pinned once for each of several markers."""
    found: dict[str, list[str]] = {}
    for entry in ENTRY.finditer(lock(name)):
        requirement = Requirement(entry["pin"])
        (specifier,) = requirement.specifier
        assert specifier.operator == "=="
        found.setdefault(canonicalize_name(requirement.name), []).append(specifier.version)
    return found


def asked_for(name: str) -> dict[str, set[str]]:
    """Names that the file says pyproject.toml asked for, by group."""
    found: dict[str, set[str]] = {}
    for entry in ENTRY.finditer(lock(name)):
        for group in re.findall(r"gpbnb \(pyproject\.toml(?::([\w-]+))?\)", entry["via"]):
            found.setdefault(group, set()).add(canonicalize_name(Requirement(entry["pin"]).name))
    return found


def requirements(name: str) -> dict[str, list[Requirement]]:
    own = PROJECT["project"]["dependencies"] + PROJECT["project"]["optional-dependencies"]["report"]
    groups = {"": own, **PROJECT["dependency-groups"]}
    return {group: [Requirement(text) for text in texts] for group, texts in groups.items() if group in LOCKS[name]}


@every_lock
def test_every_requirement_is_pinned_within_its_range(name: str):
    locked = pins(name)
    for requirement in [r for group in requirements(name).values() for r in group]:
        versions = locked[canonicalize_name(requirement.name)]
        assert all(requirement.specifier.contains(version) for version in versions), requirement


@every_lock
def test_the_lock_was_compiled_from_these_requirements(name: str):
    wanted = {group: {canonicalize_name(r.name) for r in group_} for group, group_ in requirements(name).items()}
    assert asked_for(name) == wanted


def test_the_version_is_the_same_everywhere():
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert PROJECT["project"]["version"] == gpbnb.__version__ == cited[1]
