"""The structure of the package: imports point down, names stay private, files stay short."""

import ast
import graphlib
import re
from functools import cache
from pathlib import Path

import grimp
import pytest

import gpbnb

ROOT = Path(gpbnb.__file__).parent
LONGEST_FILE = 800
TOPICS = ("rounding", "inversion", "kalman", "guarantees", "rolling", "integration", "budget", "geometry")
LIBRARY = (("files", "interrupts", "names"), ("arithmetic",), ("filters",), ("bounds",), ("wordlength",))
REPORT = (
    ("display", "examples", "measurement", "stored_table", "sweep"),
    TOPICS,
    ("gravity_probe_b",),  # its answers are compared with the bounds of the report of 1984
    ("wordlengths", "pictures", "ledger", "ledger_options", "stored", "evidence"),
)
LAYERS = (*LIBRARY, *(tuple(f"report.{name}" for name in names) for names in REPORT), ("ledger",))
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
FILES = {".".join(path.relative_to(ROOT.parent).with_suffix("").parts): path for path in sorted(ROOT.rglob("*.py"))}


def room(module):
    """The room that a module belongs to, as in "filters" or "report.kalman"; empty for the package itself."""
    parts = module.split(".")[1:]
    return ".".join(parts[:2] if parts[:1] == ["report"] else parts[:1])


@pytest.fixture(scope="module")
def imports():
    """The modules that each module imports, at its top, within its functions, or for types alone."""
    graph = grimp.build_graph("gpbnb", cache_dir=None)
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


@cache
def syntax():
    """The nodes of the syntax tree of each module."""
    return {name: tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8")))) for name, path in FILES.items()}


def test_every_room_has_its_level():
    assert {room(name) for name in FILES} - {"__init__", "__main__", "report.__init__"} <= set(LEVEL)


def test_imports_point_down(imports):
    up = [
        (module, imported)
        for module, found in imports.items()
        for imported in found
        if room(module) in LEVEL and LEVEL.get(room(imported), 0) > LEVEL[room(module)]
    ]
    assert up == []


def test_the_library_does_not_import_the_report(imports):
    library = [name for name in imports if room(name) in {each for names in LIBRARY for each in names}]
    assert [(name, each) for name in library for each in imports[name] if room(each).startswith("report")] == []


def test_topics_do_not_import_each_other(imports):
    topics = {f"report.{name}" for name in TOPICS}
    across = [
        (module, imported)
        for module, found in imports.items()
        for imported in found
        if room(module) in topics and room(imported) in topics and room(module) != room(imported)
    ]
    assert across == []


def test_no_module_imports_itself_over_others(imports):
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        pytest.fail(f"import cycle: {' <- '.join(error.args[1])}")


def test_no_import_is_for_types_alone():
    """Types come from the modules below, or from protocols; what depends on what is then the same for every tool."""
    assert [module for module, path in FILES.items() if "TYPE_CHECKING" in path.read_text(encoding="utf-8")] == []


def test_theory_does_not_know_the_experiment(imports):
    assert [m for m, found in imports.items() if m.endswith(".theory") and any("experiment" in i for i in found)] == []


def names_used(nodes):
    """Private names that a module takes from somewhere: attributes and imports."""
    for node in nodes:
        if isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gpbnb"):
            yield from (alias.name for alias in node.names)


def names_defined(nodes):
    """Names that a module defines, at its top, in its classes, or on ``self``."""
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.id if isinstance(node, ast.Name) else node.attr
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value  # __slots__


EXTERNAL = {
    "_asdict",
    "_cache_path",
    "_codegen",
    "_compiled_object",
    "_engine",
    "_ensure_finalized",
    "_fields",
    "_final_module",
    "_impl",
    "_index_path",
    "_load_data",
    "_load_overload",
    "_make",
    "_mpf_",
    "_object_caching_enabled",
    "_print",
    "_replace",
    "_repr_html_",
    "_repr_markdown_",
    "_save_data",
    "_source_stamp",
}
"""Names of other libraries that begin with an underscore."""


def test_private_names_stay_in_their_module():
    outside = {
        module: found
        for module, nodes in syntax().items()
        if (
            found := {name for name in names_used(nodes) if name.startswith("_") and not name.endswith("__")}
            - set(names_defined(nodes))
            - EXTERNAL
        )
    }
    assert outside == {}


def test_nothing_is_imported_by_string():
    called = {
        module: {ast.unparse(node.func).split(".")[-1] for node in nodes if isinstance(node, ast.Call)}
        for module, nodes in syntax().items()
    }
    forbidden = {"import_module", "__import__", "exec", "eval"}
    assert [module for module, names in called.items() if names & forbidden] == [
        "gpbnb.__init__",
        "gpbnb.report.ledger.judge",  # evaluates expressions that see the names of their topic, and no import
    ]


def test_files_are_as_long_as_their_subject():
    lengths = {module: len(path.read_text(encoding="utf-8").splitlines()) for module, path in FILES.items()}
    lengths["gpbnb.bounds.check"] -= 200  # it shares no code with the package, so it has no second file
    assert {module: length for module, length in lengths.items() if length > LONGEST_FILE} == {}


def test_the_map_of_the_house_names_every_room_and_only_files_that_exist():
    text = (
        (ROOT.parent / "CONTRIBUTING.md")
        .read_text(encoding="utf-8")
        .partition("## Structure")[2]
        .partition("## Style")[0]
    )
    rooms = {name.removeprefix("report.") for name in LEVEL} - {"ledger_options"}
    assert rooms - set(re.findall(r"\w+", text.partition("### ")[0])) - set(TOPICS) == set()
    paths = [name for name in re.findall(r"`([\w/.]+)`", text) if "/" in name and not name.startswith("tests")]
    assert len(paths) > 20
    bases = (ROOT.parent, ROOT)
    assert [name for name in paths if not any((base / name).exists() for base in bases)] == []


def test_each_class_has_a_name_of_its_own():
    """A reader who meets a name in a message or in a signature finds one class of this name."""
    homes = {}
    for module, nodes in syntax().items():
        for node in nodes:
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(module)
    assert {name: found for name, found in homes.items() if len(found) > 1 and not name.startswith("_")} == {}


LONGEST_FUNCTION, MOST_PARAMETERS = 80, 10
WIDE = {
    "gpbnb.filters.model.__init__": "public: the matrices of a model, and what may be added to them",
    "gpbnb.filters.nonlinear.__init__": "public: the functions and noises of a model, each a keyword",
    "gpbnb.wordlength.required.required_precision": "public: each is a keyword that a user may name",
}
"""Functions of more than ten parameters, and the reason. All are public: scripts and the book name these keywords."""


def functions():
    """The name of each function, its lines without docstring, and the number of its parameters without self and cls."""
    for module, nodes in syntax().items():
        for node in nodes:
            if isinstance(node, ast.FunctionDef):
                given, first = node.args, min([node.lineno, *(each.lineno for each in node.decorator_list)])
                named = [each.arg for each in (*given.posonlyargs, *given.args)]
                count = len(named) - (named[:1] in (["self"], ["cls"])) + len(given.kwonlyargs)
                count += (given.vararg is not None) + (given.kwarg is not None)
                text = node.body[0].end_lineno - node.body[0].lineno + 1 if ast.get_docstring(node) else 0
                yield f"{module}.{node.name}", node.end_lineno - first + 1 - text, count


def test_functions_are_short():
    assert {name: lines for name, lines, _ in functions() if lines > LONGEST_FUNCTION} == {}


def test_functions_have_few_parameters():
    assert {name for name, _, count in functions() if count > MOST_PARAMETERS} == set(WIDE)
