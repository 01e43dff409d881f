"""What the book needs of Sphinx beyond settings: a first page, labels, links, docstrings."""

import os
import re
from enum import Enum
from pathlib import Path
from typing import Union

import pybtex.plugin
from docutils import nodes
from pybtex.style.formatting.plain import Style as PlainStyle
from pybtex.style.labels import BaseLabelStyle
from sphinx.addnodes import start_of_file
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.inspect import TypeAliasForwardRef

from gpbnb.names import HOMES
from gpbnb.report.display.tables import POWER

REDIRECT = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="refresh" content="0; url={target}">
<title>{title}</title>
</head>
<body><main><h1>{title}</h1><p><a href="{target}">Open the book</a></p></main></body>
</html>
"""
MOVED = {
    "calculators": "rounding.html#on-your-own-format",
    "code": "processors.html#choose-a-structure",
    "contraction": "kalman.html#measure-each-step-then-add-up",
    "open": "errata.html#what-the-documents-leave-undone",
    "reading": "index.html#run-and-cite",
    "year": "kalman.html#a-year-at-t-bits",
}
"""Pages that are now part of another, in the folder of the book, and where their content is."""
CITED = re.compile(r"\[(?:\[[^\]]+\]\(bibliography\.md#\w+\)(?:, )?)+\]")


class KeyLabels(BaseLabelStyle):
    """Label an entry with its key, the short name by which text, docstrings and ledger call it."""

    def format_labels(self, sorted_entries):
        return (entry.key for entry in sorted_entries)


class ShortNames(PlainStyle):
    default_label_style = KeyLabels


def write_redirects(app: Sphinx, error: Exception | None) -> None:
    """Write index.html, which leads to the page at the root of the table of contents, and the pages that moved."""
    if error:
        return
    root = app.config.root_doc
    targets = {"index.html": app.builder.get_target_uri(root)}
    if app.builder.name == "html":
        folder = Path(root).parent
        targets |= {str(folder / f"{name}.html"): target for name, target in MOVED.items()}
    for name, target in targets.items():
        page = REDIRECT.format(title=app.config.html_title, target=target)
        Path(app.outdir, name).write_text(page, encoding="utf-8")


def unfold_fields(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Rewrite ``name : meaning``, as the docstrings of gpbnb have it, into the two lines that napoleon reads."""
    section = ""
    unfolded = []
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        if after and set(after) == {"-"}:
            section = line
        field = re.match(r"([*\w][*\w., ]*) : (.+)", line)
        if field and section in ("Parameters", "Returns", "Raises", "Attributes"):
            unfolded += [field[1], "    " + field[2]]
        else:
            unfolded.append(line)
    lines[:] = unfolded


def hide_enum_arguments(app, what, name, obj, options, signature, returns):
    """Leave out how Python makes an Enum, which nobody calls."""
    if what == "class" and isinstance(obj, type) and issubclass(obj, Enum):
        return "", None
    return None


def write_powers(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Write numbers in tables as 1.5 × 10⁻⁸ instead of 1.5e-08."""
    for box in doctree.findall(nodes.entry):
        for text in list(box.findall(nodes.Text)):
            if isinstance(text.parent, (nodes.literal, nodes.math)) or not POWER.search(text.astext()):
                continue
            written = []
            end = 0
            for number in POWER.finditer(text.astext()):
                before = text.astext()[end : number.start()]
                written.append(nodes.Text(f"{before}{number[1]}\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10"))
                written.append(nodes.superscript("", str(int(number[2])).replace("-", "−")))
                end = number.end()
            text.parent.replace(text, [*written, nodes.Text(text.astext()[end:])])


def cite_works(app: Sphinx, docname: str, source: list[str]) -> None:
    """Turn links to the bibliography in brackets, which Jupyter shows, into citations."""
    source[0] = CITED.sub(lambda links: "{cite:p}`" + ",".join(re.findall(r"md#(\w+)", links[0])) + "`", source[0])


def name_terms(app: Sphinx, env: BuildEnvironment) -> None:
    """Let links such as ``notation.md#term-tie``, which Jupyter shows, lead to terms of the glossary."""
    for (kind, _), (page, place) in env.get_domain("std").objects.items():
        if kind == "term":
            env.metadata[page]["myst_slugs"][place] = (None, place, "")


def mend_links(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Where all pages are one, lead every link to its place within it.

    Sphinx would lead those to a part of a page to ``book/index.html``, as seen from the folder above, and drop which
    page was meant, though ids such as ``id3`` stand in several; HTML outputs name the pages as they were.
    """
    if app.builder.name != "singlehtml":
        return
    page_of: dict[nodes.Node, str] = {}
    for part in doctree.findall(start_of_file):
        page_of |= dict.fromkeys(part.findall(), part["docname"])
    places: dict[tuple[str, str], nodes.Element] = {}
    pages: dict[str, set[str]] = {}
    for node in doctree.findall(nodes.Element):
        for name in node.get("ids", ()):
            page = page_of.get(node, docname)
            places[page, name] = node
            pages.setdefault(name, set()).add(page)

    def within(page: str, name: str) -> str:
        if page == docname and not name:
            name = next(iter(doctree.findall(nodes.section)))["ids"][0]
        if not name:
            return f"document-{page}"
        if len(pages.get(name, ())) < 2 or (page, name) not in places:
            return name
        alias = f"{page}-{name}"
        if alias not in (ids := places[page, name]["ids"]):
            ids.append(alias)
        return alias

    for node in list(doctree.findall(nodes.Element)):
        page = page_of.get(node, docname)
        if "refid" in node:
            node["refid"] = within(page, node["refid"])
        if node.get("backrefs"):
            node["backrefs"] = [within(page, name) for name in node["backrefs"]]
        if node.get("refuri", "").startswith("#document-"):
            page, _, name = node["refuri"].removeprefix("#document-").partition("#")
            node["refuri"] = "#" + within(page, name)
    folder = Path(docname).parent
    for node in doctree.findall(nodes.raw):
        mended = re.sub(
            r'href="([\w-]+)\.html(?:#([^"]+))?"',
            lambda match: f'href="#{within((folder / match[1]).as_posix(), match[2] or "")}"',
            node.astext(),
        )
        node.children = [nodes.Text(mended)]
        node.rawsource = mended


def link_public_name(app: Sphinx, env: BuildEnvironment, node: nodes.Element, content: nodes.Node) -> nodes.Node | None:
    """Link a public name to its place in the reference; signatures name the module that defines it."""
    target = node.get("reftarget", "")
    for name, module in HOMES.items():
        defined = module if name == "linalg" else f"{module}.{name}"
        if node.get("refdomain") == "py" and f"{target}.".startswith(f"{defined}."):
            public = target.replace(defined, f"gpbnb.{name}", 1)
            domain = env.get_domain("py")
            return domain.resolve_xref(env, node["refdoc"], app.builder, node["reftype"], public, node, content)
    return None


def number_figures(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Number figures from 1 to the end of the book, also on pages without a chapter number."""
    number = 0
    for page in pages_in_order(env, app.config.root_doc):
        figures = env.toc_fignumbers.get(page, {}).get("figure", {})
        names = sorted(figures, key=figures.__getitem__)
        if names:
            env.toc_fignumbers[page]["figure"] = {name: (number + k,) for k, name in enumerate(names, 1)}
        number += len(names)
    return []


def pages_in_order(env: BuildEnvironment, page: str) -> list[str]:
    """List a page and those below it in the order of the table of contents."""
    return [page, *(each for child in env.toctree_includes.get(page, ()) for each in pages_in_order(env, child))]


def write_in_parallel(app: Sphinx, env: BuildEnvironment) -> None:
    """Write pages while others are resolved; ``jupyter-book`` has no option for it, and not all extensions read so."""
    app.parallel = os.cpu_count() or 1


def setup(app: Sphinx) -> dict:
    pybtex.plugin.register_plugin("pybtex.style.formatting", "short_names", ShortNames)
    app.connect("autodoc-process-docstring", unfold_fields, priority=400)
    # Without it, a signature such as "Numbers | None" stays a text, whose names are ambiguous; Sphinx 8.2 has it.
    TypeAliasForwardRef.__or__ = TypeAliasForwardRef.__ror__ = lambda self, other: Union[self, other]  # noqa: UP007
    app.connect("autodoc-process-signature", hide_enum_arguments)
    app.connect("missing-reference", link_public_name)
    app.connect("doctree-resolved", write_powers)
    app.connect("doctree-resolved", mend_links)
    app.connect("source-read", cite_works)
    app.connect("env-updated", name_terms)
    # Sphinx numbers the figures with the priority 500.
    app.connect("env-get-updated", number_figures, priority=900)
    app.connect("env-updated", write_in_parallel)
    app.connect("build-finished", write_redirects, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
