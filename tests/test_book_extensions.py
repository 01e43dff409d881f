"""book/_ext: what the book adds to Sphinx, piece by piece; tests/pages sees the whole."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from docutils import nodes
from docutils.utils import new_document
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace

from gpbnb.names import HOMES, NAMED_FORMATS

FOLDER = Path(__file__).resolve().parents[1] / "book" / "_ext"


def load(name):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


book, ledger, metadata = load("gpbnb_book"), load("gpbnb_ledger"), load("gpbnb_metadata")
search, weight = load("gpbnb_search"), load("gpbnb_weight")


# -- docstrings, labels, first page --------------------------------------------------------------------


def test_links_to_the_bibliography_in_brackets_become_citations():
    works = "[[Hung, 1982](bibliography.md#hung1982), [Everitt *et al.*, 2011](bibliography.md#everitt2011)]"
    source = [f"as {works} and [a term](notation.md#term-tie)"]
    book.cite_works(None, "book/page", source)
    assert source == ["as {cite:p}`hung1982,everitt2011` and [a term](notation.md#term-tie)"]


def unfolded(*lines):
    found = list(lines)
    book.unfold_fields(None, "function", "f", None, None, found)
    return found


@pytest.mark.parametrize("section", ["Parameters", "Returns", "Raises", "Attributes"])
def test_a_field_in_one_line_becomes_two(section):
    rule = "-" * len(section)
    found = unfolded("About : f.", "", section, rule, "x, *args : the numbers: all", "    and more : of it", "")
    assert found == ["About : f.", "", section, rule, "x, *args", "    the numbers: all", "    and more : of it", ""]


@pytest.mark.parametrize(
    ("defined", "public"),
    [
        ("gpbnb.arithmetic.formats.FloatFormat", "gpbnb.FloatFormat"),
        ("gpbnb.arithmetic.formats.FloatFormat.round", "gpbnb.FloatFormat.round"),
        ("gpbnb.arithmetic.linalg.inv", "gpbnb.linalg.inv"),
        ("gpbnb.arithmetic.formats.FloatFormats", None),
        ("gpbnb.filters.program.Program", None),
    ],
)
def test_a_public_name_is_linked_wherever_it_is_defined(defined, public):
    asked = []
    domain = SimpleNamespace(resolve_xref=lambda *given: asked.append(given[4]))
    node = {"refdomain": "py", "reftarget": defined, "reftype": "class", "refdoc": "book/api"}
    env = SimpleNamespace(get_domain=lambda name: domain)
    book.link_public_name(SimpleNamespace(builder=None), env, node, None)
    assert asked == [public][: public is not None]


def test_the_reference_documents_every_public_name():
    text = (FOLDER.parent / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\.\. auto\w+:: gpbnb\.(\w+)$", text, re.MULTILINE))
    assert documented == {*HOMES, "NAMED_FORMATS"} - set(NAMED_FORMATS)


def test_figures_have_one_numbering_through_the_book():
    env = SimpleNamespace(
        toctree_includes={"index": ["first", "last"], "first": ["below"]},
        toc_fignumbers={
            "last": {"figure": {"c": (2, 1)}},
            "index": {"figure": {"a": (1,)}, "table": {"t": (1,)}},
            "first": {"figure": {"y": (1, 2), "x": (1, 1), "z": (1, 10)}},
            "below": {"table": {"u": (1, 1)}},
        },
    )
    of = SimpleNamespace(config=SimpleNamespace(root_doc="index"))
    assert book.number_figures(of, env) == []
    assert {page: kinds.get("figure") for page, kinds in env.toc_fignumbers.items()} == {
        "index": {"a": (1,)},
        "first": {"x": (2,), "y": (3,), "z": (4,)},
        "last": {"c": (5,)},
        "below": None,
    }
    assert env.toc_fignumbers["index"]["table"] == {"t": (1,)}


def app(folder, builder="html"):
    return SimpleNamespace(
        outdir=str(folder),
        builder=SimpleNamespace(name=builder, get_target_uri=lambda page: f"{page}.html"),
        config=SimpleNamespace(root_doc="book/index", html_title="The title"),
    )


def test_no_page_that_moved_is_still_there():
    there = {path.stem for path in FOLDER.parent.glob("*.*")}
    assert there.isdisjoint(book.MOVED)
    for name, _, heading in (target.partition(".html#") for target in book.MOVED.values()):
        (page,) = FOLDER.parent.glob(f"{name}.*")
        headings = re.findall(r"(?<![^\s\"])#+ ([^\"\n]+?)(?:\\n)?(?=[\"\n])", page.read_text(encoding="utf-8"))
        assert heading in {re.sub(r"[^\w -]", "", each).lower().replace(" ", "-") for each in headings}


# -- search, and what is shipped ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("3,153,600 steps", ["3153600", "steps"]),
        (r"k = 3{,}153{,}600", ["k", "3153600"]),
        ("6,606.1 and 39.2", ["6606", "1", "and", "39", "2"]),
        ("(1,2,3456) 1,23", ["1", "2", "3456", "1", "23"]),
    ],
)
def test_a_number_is_one_word_of_the_search(text, words):
    assert search.Numbers({}).split(text) == words


# -- the ledger's rows as labels, its formulas and links -----------------------------------------------


def environment(*pages):
    standard = SimpleNamespace(labels={}, anonlabels={})
    return SimpleNamespace(found_docs=set(pages), get_domain={"std": standard}.__getitem__, standard=standard)


def tree(html):
    document = new_document("page")
    document += [
        nodes.paragraph("", "class"),
        nodes.raw("<br>", "<br>", format="html"),
        nodes.raw(html, html, format="html"),
    ]
    return document


def html_of(document):
    _, raw = document.findall(nodes.raw)
    return raw


LINKS = (
    '<a href="rounding.html">r</a> <a href="errata.html#hung1984.II.eq20">e</a> <a href="https://a.org/x.html">o</a>'
)


def test_links_lead_within_where_all_pages_are_one(tmp_path):
    document = tree(LINKS)
    book.mend_links(app(tmp_path, "singlehtml"), document, "book/errata")
    raw = html_of(document)
    mended = (
        '<a href="#document-book/rounding">r</a> <a href="#hung1984.II.eq20">e</a> <a href="https://a.org/x.html">o</a>'
    )
    assert raw.astext() == raw.rawsource == mended


def test_a_count_is_that_of_the_rows_with_all_its_words():
    rows = ledger.all_rows()

    def shown(text):
        ((node,), _) = ledger.count("ledger-count", "", text, 1, None)
        return node.astext()

    for document in {row.statement.document for row in rows}:
        for outcome in ("verified", "wrong", "not reproduced"):
            expected = sum(row.statement.document == document and row.outcome == outcome for row in rows)
            assert shown(f"{document} {outcome}") == str(expected)
    assert shown("statements") == f"{len(rows):,}"
    assert shown("roots") == str(len({row.finding.root for row in rows} - {""}))
    assert 0 < int(shown("claims refuted")) < int(shown("claims"))


def test_powers_of_ten_in_tables_too_but_not_in_code_and_formulas():
    document = new_document("page")
    document += [table(("a", "b"), ("1e-05 to 2e3, x2e3", "")), nodes.paragraph("", "1e-05")]
    (code, math) = nodes.literal("", "1e-05"), nodes.math("", "1e-05")
    list(document.findall(nodes.entry))[-1] += nodes.paragraph("", "", code, math)
    book.write_powers(None, document, "book/page")
    cells = [cell.astext().replace("\N{NO-BREAK SPACE}", " ") for cell in document.findall(nodes.entry)]
    assert cells[2:] == ["1 × 10−5 to 2 × 103, x2e3", "\n\n1e-051e-05"]
    assert [part.astext() for part in document.findall(nodes.superscript)] == ["−5", "3"]
    assert document[1].astext() == "1e-05"


def table(*rows):
    """A table as MyST makes it of Markdown, the first row its head."""
    group = nodes.tgroup("", *(nodes.colspec() for _ in rows[0]), cols=len(rows[0]))
    made = [nodes.row("", *(nodes.entry("", nodes.paragraph("", cell)) for cell in row)) for row in rows]
    group += [nodes.thead("", made[0]), nodes.tbody("", *made[1:])]
    return nodes.table("", group)


# -- descriptions, Open Graph, sitemap ------------------------------------------------------------------


def page_with(*paragraphs):
    document = new_document("page")
    section = nodes.section()
    document += section
    for text in paragraphs:
        section += nodes.paragraph(text, text)
    return document


def test_the_description_is_made_of_whole_sentences_without_formulas():
    long = "This sentence is long enough to end the description, " * 4 + "as it should."
    short = "How far is the computed angle from the true one? Two\nmiles."
    assert metadata.description(page_with(f"{short} [Hung, 1984] {long}")) == " ".join(short.split())
    question = "Which of the nine misalignments change the drift in a year?"
    assert metadata.description(page_with(r"With \beta it fails.", "Too short.", f"{question} These do:")) == question
    assert metadata.description(new_document("empty")) == ""


@pytest.fixture
def build(tmp_path, monkeypatch):
    """Build a book of two pages with the address in the environment, in the configuration, both or neither."""

    def build(variable=None, setting=""):
        monkeypatch.delenv("BOOK_ADDRESS", raising=False)
        if variable is not None:
            monkeypatch.setenv("BOOK_ADDRESS", variable)
        source = tmp_path / "source"
        (source / "book").mkdir(parents=True, exist_ok=True)
        (source / "index.rst").write_text("First\n=====\n\n.. toctree::\n\n   book/second\n", encoding="utf-8")
        (source / "book" / "second.rst").write_text("Second\n======\n", encoding="utf-8")
        settings = {"extensions": ["gpbnb_metadata"], "html_baseurl": setting, "html_theme": "basic"}
        monkeypatch.syspath_prepend(str(FOLDER))
        folders = (str(source), None, str(tmp_path / "html"), str(tmp_path / "doctrees"))
        with docutils_namespace():
            Sphinx(*folders, "html", confoverrides=settings, status=None, warning=None).build(force_all=True)
        return tmp_path / "html"

    return build


@pytest.mark.parametrize(
    "given", [{"variable": "https://example.org/gpbnb"}, {"setting": "https://example.org/gpbnb/"}]
)
def test_a_published_book_has_full_addresses(build, given):
    html = build(**given)
    page = (html / "book" / "second.html").read_text(encoding="utf-8")
    there = "https://example.org/gpbnb"
    assert f'<meta property="og:image" content="{there}/_static/preview.png">' in page
    assert f'<meta property="og:url" content="{there}/book/second.html">' in page
    assert f'<link rel="canonical" href="{there}/book/second.html"' in page
    assert f"<loc>{there}/book/second.html</loc>" in (html / "sitemap.xml").read_text(encoding="utf-8")
