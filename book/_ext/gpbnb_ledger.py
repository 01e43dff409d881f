"""The ledger in the book: the directive ``ledger``, labels of its rows for ``{ref}``, and MathJax for its formulas."""

from functools import cache
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.docutils import SphinxDirective

from gpbnb.report import ledger

ERRORS = ("wrong", "inconsistent", "not reproduced")
"""What a chapter lists; misprints and faults of the scan are in the complete ledger."""


@cache
def all_rows():
    return ledger.rows()


class Ledger(SphinxDirective):
    """Show a part of the ledger.

    ``page NAME`` is a page of the complete ledger; ``errors TOPIC`` the errors in the statements of a chapter;
    ``verdict NAME`` the statements with one verdict; ``undone NAME`` what the documents leave undone, with one verdict;
    ``roots`` the root errors, and ``root-squares`` the squares of what each affects; ``squares`` every statement as a
    square; ``argument`` how wrong statements pass from one part of the documents to the next; ``correction`` the main
    result above its correction; ``timeline`` the history, with sources; ``claims`` the principal claims;
    ``counts BY`` counts by document, chapter or kind; ``documents`` the bibliographic record of each document.
    """

    required_arguments = 1
    optional_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        for path in Path(ledger.__file__).parent.iterdir():
            self.env.note_dependency(str(path))
        what, *detail = (" ".join(argument.split()) for argument in self.arguments)
        if what == "counts":
            parsed = self.parse_text_to_nodes(ledger.count_table(all_rows(), detail[0]).page())
            for table in (found for node in parsed for found in node.findall(nodes.table)):
                table["classes"].append("counts")
            return parsed
        if what == "documents":
            return self.parse_text_to_nodes(ledger.document_table().page())
        if what == "timeline":
            from gpbnb.report.gravity_probe_b import timeline

            return [nodes.raw("", timeline.picture(), format="html"), *self.parse_text_to_nodes(timeline.sources())]
        return [nodes.raw("", self.html(what, *detail), format="html")]

    def html(self, what: str, detail: str = "") -> str:
        rows, verdict = all_rows(), ledger.finding.Verdict
        match what:
            case "page":
                page = next(page for page in ledger.PAGES if page.name == detail)
                return ledger.ledger_page(rows, page).html
            case "errors":
                return ledger.error_table(ledger.select_topic(rows, detail, *map(verdict, ERRORS))).html
            case "verdict":
                chosen = verdict(detail)
                return ledger.note_table(row for row in rows if row.finding.verdict is chosen).html
            case "undone":
                chosen = verdict(detail)
                items = (row for row in rows if row.statement.kind == "open")
                return ledger.note_table((r for r in items if r.finding.verdict is chosen), True).html
            case "squares":
                return ledger.squares(rows).html
            case "root-squares":
                return ledger.root_squares(rows).html
            case "argument":
                from gpbnb.report.ledger.argument import chain_of_errors  # matplotlib takes a second to import

                return chain_of_errors(rows).html
            case "correction":
                from gpbnb.report.ledger.correction import with_correction

                return with_correction().html
            case "roots":
                return ledger.root_table(rows).html
            case "claims":
                return ledger.claim_table(rows).html
        raise self.error(f"no part of the ledger is called {what!r}")


def count(name, rawtext, text, lineno, inliner, options=None, content=None):
    """Write a count: of ``statements``, ``roots``, statements with a ``damaged`` scan, of a document, of a verdict.

    A document and a verdict may be combined, as in ``hung1984 wrong``. ``claims`` counts the principal claims, and
    ``claims refuted`` those with this outcome.
    """
    rows = all_rows()
    if text.startswith("claims"):
        outcomes = [*ledger.claim_outcomes(rows).values()]
        found = outcomes.count(text.removeprefix("claims ")) if " " in text else len(outcomes)
    elif text == "roots":
        found = len(ledger.by_root(rows))
    elif text == "damaged":
        found = len(ledger.load_legibility())
    else:
        words = text.replace("not reproduced", "not-reproduced").split()
        kept = [
            row for row in rows if {row.statement.document, row.outcome.replace(" ", "-"), "statements"} >= set(words)
        ]
        found = len(kept)
    return [nodes.Text(f"{found:,}")], []


def add_labels(app: Sphinx, env: BuildEnvironment) -> None:
    """Give each statement a label: the rows are HTML, in which Sphinx finds none."""
    standard = env.get_domain("std")
    for statement in ledger.load_statements():
        page = next(page for page in ledger.PAGES if page.holds(statement))
        name = f"book/{page.name}"
        if name not in env.found_docs:
            continue
        title = ", ".join(part for part in (statement.document, statement.chapter, statement.item) if part != "-")
        standard.labels[statement.id.lower()] = (name, statement.id, title)
        standard.anonlabels[statement.id.lower()] = (name, statement.id)


def ask_for_mathjax(app: Sphinx, doctree: nodes.document) -> None:
    """Load MathJax on pages whose only formulas are in HTML."""
    if any('class="math' in node.astext() for node in doctree.findall(nodes.raw)):
        app.env.get_domain("math").data["has_equations"][app.env.docname] = True


def setup(app: Sphinx) -> dict:
    app.add_directive("ledger", Ledger)
    app.add_role("ledger-count", count)
    app.connect("doctree-read", ask_for_mathjax)
    app.connect("env-updated", add_labels)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
