"""Numerals in the text of the book: computed ones come by glue; all others are in typed_numerals.csv with a reason."""

from __future__ import annotations

import ast
import csv
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*(ROOT / "book").glob("*.ipynb"), *(ROOT / "book").glob("*.md")])
NOT_PROSE = re.compile(
    "|".join(
        (
            r"^```\{glossary\}$|```.*?```|^```$",  # code and figures, but not the glossary
            r"^:{3,}.*?$|^:\w+:.*?$",  # directives and their options
            r"\$\$.*?\$\$|\$[^$]*\$",  # math
            r"\{[\w:-]+\}`[^`]*`|`[^`]*`",  # roles, glue among them, and inline code
            r"(?<=\])\([^)\s]*\)",  # where a link leads
            r'"[^"\n]{,200}"',  # quotations
            r"\(\d{1,3}[a-z]?\)",  # numbers of equations
            r"\b(?:[Ss]ections?|Table|Fig\.|Figure) [\dIVX][\w.-]*(?:(?:,| to| and) \d[\w.]*)*",
            r"\b(?:1982|1984|2016)\b",  # the documents
            r"^\d+\. ",  # numbers of a list
        )
    ),
    re.DOTALL | re.MULTILINE,
)
NUMERAL = re.compile(r"(?<![\w-])\.?\d[\d.,]*")

#: Phrases with a numeral that was not computed: what a document printed, what a computation was given, what follows
#: from these by counting (exact), formats and names, and facts from a cited source (cited).
TYPED = list(csv.DictReader((ROOT / "tests" / "typed_numerals.csv").read_text(encoding="utf-8").splitlines()))
REASONS = {"printed", "given", "exact", "formats", "names", "cited"}
#: Sentences of the README, which cannot glue: what it says, and the number in the book, rounded to so many places.
README = {
    "known to 31 arcseconds,": ("rolling", "rolling_limit", 31, 0),
    "eight equations on the way": ("integration", "slipped", 8, 0),
    "a hundred thousand random inverses": ("inversion", "inv_given", 100_000, -4),
}


def prose(page: Path) -> str:
    """Text and captions of a page, without what is no prose; white space as single blanks."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        parts = []
        for cell in json.loads(text)["cells"]:
            figure = cell["metadata"].get("mystnb", {}).get("figure", {})
            parts.append("".join(cell["source"]) if cell["cell_type"] == "markdown" else figure.get("caption", ""))
        text = "\n\n".join(parts)
    return strip(text)


def strip(text: str) -> str:
    return " ".join(NOT_PROSE.sub(" · ", text).split())


def numerals(text: str) -> list[str]:
    """Each numeral with what stands around it."""
    return [text[max(0, found.start() - 40) : found.end() + 25] for found in NUMERAL.finditer(text)]


def glued(page: str, key: str) -> float:
    for cell in json.loads((ROOT / "book" / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]:
        for output in cell.get("outputs", []):
            if output.get("metadata", {}).get("scrapbook", {}).get("name") == key:
                return float(ast.literal_eval("".join(output["data"]["application/papermill.record/text/plain"])))
    raise KeyError(f"{page} glues no {key}")


def test_a_typed_numeral_is_found_and_what_is_no_prose_is_passed_over():
    text = (
        'It is 3.5 times (18) of 1984, {glue:text}`a:.2f`, `4`, $5$, "6 of 7", [8](x#9), section 1.2: by .25%, float64'
    )
    assert NUMERAL.findall(strip(text)) == ["3.5", "8", ".25"]
    assert numerals("It is 3.5 times") == ["It is 3.5 times"]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_result_is_typed(page):
    text = prose(page)
    for row in TYPED:
        if row["page"] == page.stem:
            assert row["phrase"] in text, (row, "is no longer there: drop it from the list")
            text = text.replace(row["phrase"], " ")
    assert numerals(text) == [], "put a computed number in by glue; list one that was not computed, with the reason"


def test_each_line_of_the_list_has_a_page_a_reason_and_a_numeral():
    assert {row["page"] for row in TYPED} <= {page.stem for page in PAGES}
    assert {row["reason"] for row in TYPED} == REASONS
    assert [row for row in TYPED if not NUMERAL.search(row["phrase"])] == []


@pytest.mark.parametrize("phrase", README)
def test_the_readme_says_what_the_book_computes(phrase):
    page, key, number, places = README[phrase]
    assert phrase in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert round(glued(page, key), places) == number


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "CHANGELOG.md"])
def test_links_to_files_lead_to_files(name):
    targets = re.findall(r"\]\(([^)\s]+)\)", (ROOT / name).read_text(encoding="utf-8"))
    assert [each for each in targets if "://" not in each and not (ROOT / each.partition("#")[0]).exists()] == []
