"""The form of the notebooks. Their results are compared by nbval, which passes over a cell that was never run."""

from __future__ import annotations

import ast
import builtins
import json
import re
from pathlib import Path

import pytest

BOOK = Path(__file__).resolve().parents[1] / "book"
PATHS = sorted(BOOK.glob("*.ipynb"))
MOST_LINES = 30
MOST_LINES_OF_A_FUNCTION = 17
OPEN = ("integration", "inversion", "kalman", "rolling", "rounding")
"""Chapters whose cells do the work in sight."""
ABSOLUTE = re.compile(r"(?<![\w.:/<])/(home|root|Users|work|tmp|usr|opt|var|private|mnt|srv)/|\b[A-Z]:\\\\")
MOST_DIGITS = 6
# A number in a text, not part of a name, an address or a fraction.
NUMBER = re.compile(r"(?<![\w.#/&])(?<!\w-)\d+(?:[ ,\u2009\u202f]\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
EXACT = {
    "arithmetic": ("1.000000015e+400", "3.402823e+38"),  # emulated arithmetic of base 2; the largest of binary32
    # FixIF's printed digits, enclosed in ball arithmetic to 2**-40.
    "guarantee": (
        "145.139332", "34.741618", "193.462195", "158.717940", "41.714171", "37.895201", "36.634411", "3.332191",
        "4.058380",
    ),
    "rounding": ("0.1024997831",),  # emulated arithmetic of base 16
}  # fmt: skip
"""Long numbers that exact or emulated arithmetic gives to the last digit."""
PICTURES = ("image/png", "image/svg+xml", "image/jpeg")


def code_cells(path: Path) -> list[dict]:
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def prose(path: Path) -> str:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")


def texts(path: Path) -> list[str]:
    """Everything a reader sees of a notebook, pictures aside."""
    found = ["".join(cell["source"]) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]]
    for cell in code_cells(path):
        for output in cell["outputs"]:
            found.append("".join(output.get("text", [])))
            data = output.get("data", {})
            found += ["".join(value) for kind, value in data.items() if kind.startswith("text/")]
    return found


each_notebook = pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)


def test_every_page_is_in_the_contents():
    """A page that is in none is not built."""
    contents = (BOOK.parent / "_toc.yml").read_text(encoding="utf-8")
    listed = {Path(name).stem for name in re.findall(r"(?:file|root): (\S+)", contents)}
    assert listed == {path.stem for path in [*PATHS, *BOOK.glob("*.md")]}


@each_notebook
def test_every_cell_was_executed_in_order(path):
    cells = code_cells(path)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))


@each_notebook
def test_no_cell_failed_or_warned(path):
    outputs = [output for cell in code_cells(path) for output in cell["outputs"]]
    assert [o for o in outputs if o["output_type"] == "error" or o.get("name") == "stderr"] == []


@each_notebook
def test_cells_and_functions_are_short(path):
    for cell in code_cells(path):
        source = "".join(cell["source"])
        assert len([line for line in source.splitlines() if line.strip()]) <= MOST_LINES, source
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                assert node.end_lineno - node.lineno < MOST_LINES_OF_A_FUNCTION, source


def visible(cell: dict) -> bool:
    return not tags(cell) & {"remove-cell", "remove-input", "hide-input", "hide-cell"}


@each_notebook
def test_a_page_shows_its_code_and_all_that_the_code_uses(path):
    cells = code_cells(path)
    lines = {shown: sum(len(c["source"]) for c in cells if visible(c) is shown) for shown in (True, False)}
    assert lines[True] >= lines[False]
    known, missing = set(dir(builtins)), []
    for cell in cells:
        if visible(cell):
            read, defined = names("".join(cell["source"]))
            missing += sorted(read - defined - known)
            known |= defined
    assert missing == []


@each_notebook
def test_a_page_glues_nothing_into_its_text_and_a_chapter_ends_with_exercises(path):
    text = prose(path)
    assert "{glue:" not in text
    assert "## Exercises" in text or path.stem not in OPEN


@each_notebook
def test_jupyter_shows_terms_works_and_pages_without_an_extension(path):
    text = prose(path)
    assert re.findall(r"\{(?:term|cite)|\[\]\(", text) == []
    works = dict(re.findall(r"@\w+\{(\w+),(.*?)\n\}", (BOOK / "references.bib").read_text(encoding="utf-8"), re.DOTALL))
    for name, year, key in re.findall(r"\[([A-Za-z]+)[^\]]*, (\d{4})\]\(bibliography\.md#(\w+)\)", text):
        assert name in works[key]
        assert f"{{{year}}}" in works[key]


@each_notebook
def test_no_path_of_one_machine(path):
    assert [text for text in texts(path) if ABSOLUTE.search(text)] == []


@each_notebook
def test_every_figure_has_alt_text_and_a_caption(path):
    for cell in code_cells(path):
        kinds = [kind for output in cell["outputs"] for kind in output.get("data", {})]
        # JupyterLab hides SVG until the notebook has run.
        assert kinds.count("image/svg+xml") == kinds.count("image/png")
        if not set(kinds).isdisjoint(PICTURES):
            settings = cell["metadata"].get("mystnb", {})
            assert settings.get("image", {}).get("alt", "").strip(), "".join(cell["source"])
            assert settings.get("figure", {}).get("caption", "").strip(), "".join(cell["source"])


def significant_digits(number: str) -> int:
    """Of a number that is written with a point; whole numbers are counts or exact, however long they are."""
    whole, _, fraction = number.partition("e")[0].partition(".")
    if not fraction.strip("0"):
        return 0
    return len((re.sub(r"\D", "", whole) + fraction).lstrip("0"))


def long_numbers(cell: dict) -> list[str]:
    """Numbers in the outputs of a cell with more digits than every processor gives alike."""
    found = []
    for output in cell["outputs"]:
        parts = ["".join(output.get("text", []))]
        parts += [
            "".join(v) for kind, v in output.get("data", {}).items() if "image" not in kind and "json" not in kind
        ]
        for part in parts:
            numbers = NUMBER.findall(re.sub(r"<[^>]*>", " ", part))
            found += [number for number in numbers if significant_digits(number) > MOST_DIGITS]
    return found


@each_notebook
def test_outputs_have_no_digits_that_differ_between_processors(path):
    exact = {number for name, numbers in EXACT.items() if name == path.stem for number in numbers}
    wrong = [number for cell in code_cells(path) for number in long_numbers(cell) if number not in exact]
    assert wrong == [], f"print at most {MOST_DIGITS} digits, or list an exact number in EXACT"


def tags(cell: dict) -> set[str]:
    return set(cell["metadata"].get("tags", []))


def names(source: str) -> tuple[set[str], set[str]]:
    """The names that a cell reads, and those that it defines."""
    nodes = list(ast.walk(ast.parse(source)))
    read = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
    defined = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    defined |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    defined |= {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    defined |= {node.name for node in nodes if isinstance(node, ast.ExceptHandler) and node.name}
    for node in nodes:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            defined |= {alias.asname or alias.name.split(".")[0] for alias in node.names}
    return read, defined


# A form, a rounding or a basis as the code calls it; a letter of a formula may be called chop.
BASIS = r"\((?:emulation|bound|guarantee|probable), \d+ steps?\)"
CODE_NAME = re.compile(rf"(?<!text\{{)\b(?:hung|hung_second_gain|chop|ud)\b|{BASIS}|aim / reached")


@each_notebook
def test_no_output_shows_a_name_of_the_code(path):
    """Forms and roundings have words for readers: Hung (1984), chopped, UD."""
    shown = [output for cell in code_cells(path) if "remove-cell" not in tags(cell) for output in cell["outputs"]]
    texts = ["".join(output.get("text", [])) for output in shown]
    kinds = ("text/markdown", "text/plain")
    texts += ["".join(output.get("data", {}).get(kind, "")) for output in shown for kind in kinds]
    assert [match[0] for text in texts for match in CODE_NAME.finditer(text)] == []


@pytest.mark.parametrize(
    "name", ["wordlength", "mission", "nonlinear", "processors", "principles", "arithmetic", "guarantee", "budget"]
)
def test_a_page_of_use_ends_with_three_exercises_whose_answers_are_folded_and_computed(name):
    notebook = json.loads((BOOK / f"{name}.ipynb").read_text(encoding="utf-8"))
    start = next(k for k, cell in enumerate(notebook["cells"]) if "## Exercises" in "".join(cell["source"]))
    questions, answers = notebook["cells"][start::2], notebook["cells"][start + 1 :: 2]
    assert [re.findall(r"(?m)^(\d)\. ", "".join(cell["source"])) for cell in questions] == [["1"], ["2"], ["3"]]
    for cell in answers:
        assert tags(cell) == {"hide-cell"}
        assert cell["metadata"]["mystnb"]["code_prompt_show"] == "Show the answer"
        (output,) = cell["outputs"]
        assert re.search(r"\d", "".join(output["text"]))
        assert "".join(cell["source"]).splitlines()[-1].startswith("# ")
