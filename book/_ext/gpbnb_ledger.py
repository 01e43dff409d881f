"""The ledger in the book: labels of its rows for ``{ref}``, MathJax for its HTML, and one form for its tables."""

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

from gpbnb.ledger import load_statements
from gpbnb.ledger.page import EMPHASIS

PAGE = "book/errata"
HEADER = ["Item", "Verdict", "Printed", "Recomputed", "Note"]


def add_labels(app: Sphinx, env: BuildEnvironment) -> None:
    """Give each entry a label: the rows are HTML, in which Sphinx finds none."""
    if PAGE not in env.found_docs:
        return
    standard = env.get_domain("std")
    for entry in load_statements():
        title = ", ".join(part for part in (entry.document, entry.chapter, entry.item) if part != "-")
        standard.labels[entry.id.lower()] = (PAGE, entry.id, title)
        standard.anonlabels[entry.id.lower()] = (PAGE, entry.id)


def ask_for_mathjax(app: Sphinx, doctree: nodes.document) -> None:
    """Have MathJax on pages whose only formulas are in HTML outputs."""
    if any('class="math' in node.astext() for node in doctree.findall(nodes.raw)):
        app.env.get_domain("math").data["has_equations"][app.env.docname] = True


def join_columns(app: Sphinx, doctree: nodes.document) -> None:
    """Give the chapters' tables of the ledger the three columns of the complete one: five do not fit the page."""
    for group in list(doctree.findall(nodes.tgroup)):
        head = next(group.findall(nodes.thead), None)
        if head is None or [entry.astext() for entry in head.findall(nodes.entry)] != HEADER:
            continue
        for spec in [spec for spec in group if isinstance(spec, nodes.colspec)][3:]:
            group.remove(spec)
        group["cols"] = 3
        next(group.findall(nodes.colspec))["stub"] = 1
        for row in group.findall(nodes.row):
            wide, *others = row[2:]
            for cell in others:
                row.remove(cell)
            if row.parent is head:
                wide.children = [nodes.paragraph("", "Printed, recomputed, and note")]
                continue
            parts = []
            for name, cell in zip(("printed", "recomputed", "note"), (wide, *others), strict=True):
                parts += [paragraph for paragraph in cell if paragraph.astext()]
                for paragraph in cell:
                    paragraph["classes"].append(name)
            wide.children = []
            wide.extend(parts)
        for text in list(group.findall(nodes.Text)):
            # Stars in the notes are the ledger's own, which Markdown was not to read.
            parts = EMPHASIS.split(text.astext())
            if len(parts) > 1 and not isinstance(text.parent, nodes.math):
                marked = [nodes.emphasis("", p) if i % 2 else nodes.Text(p) for i, p in enumerate(parts)]
                text.parent.replace(text, marked)
        table = group.parent.deepcopy()
        table["classes"].append("ledger-table")
        group.parent.replace_self(nodes.container("", table, classes=["ledger"]))


def setup(app: Sphinx) -> dict:
    app.connect("doctree-read", ask_for_mathjax)
    app.connect("doctree-read", join_columns)
    app.connect("env-updated", add_labels)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
