"""Labels of the ledger's rows, so that any page can name one in ``{ref}``, and MathJax and links for its HTML."""

import re

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

from gpbnb.ledger import load_inventory

PAGE = "book/errata"


def add_labels(app: Sphinx, env: BuildEnvironment) -> None:
    """Give each entry a label: the rows are HTML, in which Sphinx finds none."""
    if PAGE not in env.found_docs:
        return
    standard = env.get_domain("std")
    for entry in load_inventory():
        title = ", ".join(part for part in (entry.document, entry.chapter, entry.item) if part != "-")
        standard.labels[entry.id.lower()] = (PAGE, entry.id, title)
        standard.anonlabels[entry.id.lower()] = (PAGE, entry.id)


def ask_for_mathjax(app: Sphinx, doctree: nodes.document) -> None:
    """Have MathJax on pages whose only formulas are in HTML outputs."""
    if any('class="math' in node.astext() for node in doctree.findall(nodes.raw)):
        app.env.get_domain("math").data["has_equations"][app.env.docname] = True


def mend_links(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Where all pages are one, lead the links of HTML outputs to places within it."""
    if app.builder.name != "singlehtml":
        return
    for node in doctree.findall(nodes.raw):
        mended = re.sub(r'href="(\w+)\.html(?:#([^"]+))?"', _within, node.astext())
        node.children = [nodes.Text(mended)]
        node.rawsource = mended


def _within(match: re.Match) -> str:
    return f'href="#{match[2] or f"document-book/{match[1]}"}"'


def setup(app: Sphinx) -> dict:
    app.connect("doctree-read", ask_for_mathjax)
    app.connect("env-updated", add_labels)
    app.connect("doctree-resolved", mend_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
