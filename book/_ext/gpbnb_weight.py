"""Ship what pages use and no more: a light MathJax, style rules that apply, no unused files."""

import re
import shutil
from collections.abc import Iterator
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
CLASS = re.compile(r"\.((?:[\w-]|\\.)+)")
SIGN = re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'|[{};]")
"""A sign that structures a style sheet, or a string, within which it would not."""
IN_PAGES = re.compile(r'class="([^"]*)"')
IN_SCRIPTS = re.compile(r"[\w-]+")
PUT_TOGETHER = ("bs-tooltip-auto",)
"""Classes that Bootstrap puts together from parts."""


def rules(css: str) -> Iterator[tuple[str, str]]:
    """Yield the rules of a style sheet as head and body; a statement such as ``@import`` has no body."""
    head = body = depth = 0
    for sign in SIGN.finditer(css):
        if sign[0] == "{":
            body = body if depth else sign.end()
            depth += 1
        elif sign[0] == "}":
            depth -= 1
            if not depth:
                yield css[head : body - 1].strip(), css[body : sign.start()]
                head = sign.end()
        elif sign[0] == ";" and not depth:
            yield css[head : sign.end()].strip(), ""
            head = sign.end()
    if depth:
        raise ValueError(f"got a style sheet whose rule {css[head:][:60]!r} does not end; needed balanced braces")


def selectors(head: str) -> list[str]:
    """Split the head of a rule at its commas, except those within brackets, as in ``:is(a, b)``."""
    parts, depth = [""], 0
    for sign in head:
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(sign, 0)
        if sign == "," and not depth:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def applies(selector: str, names: set[str]) -> bool:
    """Return whether a page or a script names each class of a selector; those within brackets need not be anywhere."""
    while (plain := re.sub(r"\([^()]*\)|\[[^\]]*\]", "", selector)) != selector:
        selector = plain
    found = [name.replace("\\", "") for name in CLASS.findall(selector)]
    return names.issuperset(found)


def applying(css: str, names: set[str]) -> str:
    """Return a style sheet without the rules for classes that no page and no script names."""
    kept = []
    for head, body in rules(re.sub(r"/\*.*?\*/", "", css, flags=re.DOTALL)):
        if head.startswith(("@media", "@supports", "@layer")):
            if inner := applying(body, names):
                kept.append(f"{head}{{{inner}}}")
        elif head.startswith("@"):
            kept.append(f"{head}{{{body}}}" if body else head)
        elif used := [each for each in selectors(head) if applies(each, names)]:
            kept.append(f"{','.join(used)}{{{body}}}")
    return "".join(kept)


def write_light_pages(folder: Path) -> None:
    """Leave out the marks of names, brackets and spaces in code, which have the colour of the code around them."""
    for page in folder.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        page.write_text(re.sub(r'<span class="[npw]">([^<]*)</span>', r"\1", text), encoding="utf-8")


def write_light_styles(folder: Path) -> None:
    """Rewrite each style sheet of a built book."""
    names = set(PUT_TOGETHER)
    for page in folder.rglob("*.html"):
        for found in IN_PAGES.findall(page.read_text(encoding="utf-8")):
            names.update(found.split())
    for script in (folder / "_static").rglob("*.js"):
        if "mathjax" not in script.parts:
            names.update(IN_SCRIPTS.findall(script.read_text(encoding="utf-8")))
    for sheet in (folder / "_static").rglob("*.css"):
        sheet.write_text(applying(sheet.read_text(encoding="utf-8"), names), encoding="utf-8")


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
    write_light_pages(folder)
    write_light_styles(folder)


def setup(app: Sphinx) -> dict:
    app.connect("html-page-context", leave_out_mathjax, priority=900)
    app.connect("build-finished", lighten, priority=700)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
