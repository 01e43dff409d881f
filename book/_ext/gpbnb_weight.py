"""Ship what pages use and no more: the parts of MathJax that the formulas need, and no unused files of the themes."""

import shutil
from importlib.metadata import distribution
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.fileutil import copy_asset

# Of the 24 MB in the package: what book/_config.yml loads, with the fonts.
MATHJAX_PARTS = (
    "startup.js",
    "core.js",
    "input/tex-base.js",
    "input/tex/extensions/ams.js",
    "input/tex/extensions/newcommand.js",
    "input/tex/extensions/configmacros.js",
    "output/chtml.js",
    "output/chtml/fonts",
    "a11y/assistive-mml.js",
)
UNUSED = (
    "_static/webpack-macros.html",
    "_static/sbt-webpack-macros.html",
    "_static/scripts/fontawesome.js*",
    "_static/**/*.map",
    "_static/vendor",
    "_static/locales",
    "_static/file.png",
    "_static/minus.png",
    "_static/plus.png",
)
"""Templates that the themes ship as pages, icons that book/_static/icons.css draws, sources, translations."""


def copy_mathjax(folder: Path) -> None:
    """Copy MathJax after the build, so that Jupyter Book does not load each of its scripts on every page."""
    source = Path(distribution("sphinx-mathjax-offline").locate_file("sphinx-mathjax-offline/static/mathjax"))
    for part in MATHJAX_PARTS:
        target = folder / "_static" / "mathjax" / part
        copy_asset(str(source / part), str(target if (source / part).is_dir() else target.parent))


def leave_out_mathjax(app: Sphinx, pagename: str, templatename: str, context: dict, doctree: object) -> None:
    """Load MathJax on pages with formulas alone; Sphinx also loads it on those that only list such a page."""
    if app.builder.name == "html" and not app.env.get_domain("math").data["has_equations"].get(pagename):
        scripts = context["script_files"]
        context["script_files"] = [
            each for each in scripts if "mathjax" not in f"{each.filename} {each.attributes.get('body')}".lower()
        ]


def lighten(app: Sphinx, error: Exception | None) -> None:
    """Complete and lighten a built book."""
    if error or app.builder.format != "html":
        return
    folder = Path(app.outdir)
    for pattern in UNUSED:
        for found in folder.glob(pattern):
            shutil.rmtree(found) if found.is_dir() else found.unlink()
    copy_mathjax(folder)


def setup(app: Sphinx) -> dict:
    app.connect("html-page-context", leave_out_mathjax, priority=900)
    app.connect("build-finished", lighten, priority=700)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
