"""Texts that depend on the address of the project: role ``address`` for words, directive ``address`` for code."""

import sys
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
import address

CITATION = """@software{{gpbnb,
  author  = {{{{The gpbnb authors}}}},
  title   = {{gpbnb: the {{Gravity Probe B}} error analysis, recomputed}},
  version = {{{version}}},
  year    = {{2026}},
{url}}}
"""


class AddressCode(SphinxDirective):
    """Show a block of code: ``install``, or ``citation`` as BibTeX."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        found = address.phrases(address.read())
        self.env.note_dependency(str(address.ROOT / "pyproject.toml"))
        if self.arguments[0] == "citation":
            text, language = CITATION.format(url=found["url"], version=version()), "bibtex"
        else:
            text, language = found["install"], "sh"
        block = nodes.literal_block(text, text)
        block["language"] = language
        return [block]


def version() -> str:
    """Return the version of the package."""
    from gpbnb import __version__

    return __version__


def words(name, rawtext, text, lineno, inliner, options=None, content=None):
    """Write ``clone`` or ``help``, with links."""
    phrase = address.phrases(address.read())[text]
    parts, end = [], 0
    for link in address.LINK.finditer(phrase):
        target = link[2] or link[3]
        parts += [nodes.Text(phrase[end : link.start()]), nodes.reference("", link[1] or target, refuri=target)]
        end = link.end()
    return [*parts, nodes.Text(phrase[end:])], []


def setup(app: Sphinx) -> dict:
    app.add_directive("address", AddressCode)
    app.add_role("address", words)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
