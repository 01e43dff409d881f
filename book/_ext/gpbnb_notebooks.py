"""Build the book from executed copies of the notebooks, which the cache of `scripts/execute_notebooks.py` keeps.

MyST-NB executes one notebook after the other, and its cache does not notice changes in the package.
"""

import copy
import gc
import hashlib
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.environment.collectors.toctree import TocTreeCollector
from sphinx.errors import ExtensionError
from sphinx.util import logging

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
import execute_notebooks

LOGGER = logging.getLogger(__name__)
COPIES = "executed"
MOST_JOBS = 8


def execute(app: Sphinx) -> None:
    """Begin to execute the notebooks whose outputs are not known."""
    found = app.project.discover(app.config.exclude_patterns, app.config.include_patterns)
    paths = [path for each in sorted(found) if (path := Path(app.env.doc2path(each))).suffix == ".ipynb"]
    pool = ThreadPoolExecutor(1)
    app.gpbnb_executed = pool.submit(execute_notebooks.executed, paths, say=LOGGER.info)
    pool.shutdown(wait=False)


def lay_copies(app: Sphinx) -> None:
    """Wait for the outputs of all notebooks, and lay executed copies beside the pages."""
    if app.config.gpbnb_outputs:
        return
    try:
        notebooks = app.gpbnb_executed.result()
    except ExceptionGroup as group:
        raise ExtensionError("\n\n".join(map(str, group.exceptions))) from group
    folder = copies(app)
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256()
    for path, notebook in notebooks.items():
        execute_notebooks.write(folder / path.name, notebook)
        for cell in notebook.cells:
            digest.update(repr(cell.get("outputs")).encode())
    app.config.gpbnb_outputs = app.env.gpbnb_outputs = digest.hexdigest()


def copies(app: Sphinx) -> Path:
    return Path(app.outdir).parent / COPIES


def use_copy(app: Sphinx, docname: str, source: list[str]) -> None:
    """Read the executed copy of a notebook in place of the notebook.

    Sphinx reads the pages of a new book in alphabetical order. Those of the API come first, and need no outputs.
    """
    if not docname.startswith("book/api"):
        lay_copies(app)
    path = Path(app.env.doc2path(docname))
    if path.suffix == ".ipynb":
        copy = copies(app) / path.name
        app.env.note_dependency(str(copy))
        source[0] = copy.read_text(encoding="utf-8")


def number_read_trees(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Number figures in the pages as they were read: Sphinx would load each of them again."""
    read, load = env._write_doc_doctree_cache, env.get_doctree
    env.get_doctree = lambda name: read[name] if name in read else load(name)
    return []


def keep_numbers(app: Sphinx, env: BuildEnvironment, docnames: list[str]) -> None:
    """Keep the numbers of figures when no page is to be read: Sphinx would load all pages to count them again."""
    app.gpbnb_numbers = copy.deepcopy(env.toc_fignumbers)
    if not docnames and env.toc_fignumbers:
        for listener in app.events.listeners["env-get-updated"][:]:
            if isinstance(getattr(listener.handler, "__self__", None), TocTreeCollector):
                app.disconnect(listener.id)


def renumbered(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Write all pages again if a figure has another number: Sphinx would not write those that refer to it."""
    del env.get_doctree
    return sorted(env.found_docs) if app.gpbnb_numbers not in ({}, env.toc_fignumbers) else []


def keep_contents(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Keep the first page, whose table of contents every page shows: Sphinx would read it for each page again."""
    first = env.get_doctree(app.config.root_doc)
    BuildEnvironment.master_doctree = property(lambda _: first)
    return []


def write_in_parallel(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Let several processes write the pages. sphinx-proof cannot be read in parallel."""
    app.parallel = max(app.parallel, min(os.cpu_count() or 1, MOST_JOBS))
    return []


def outdated(app: Sphinx, env: BuildEnvironment, added: set[str], changed: set[str], removed: set[str]) -> list[str]:
    """Read all pages again if an output has changed, as any page may show a number of any notebook, or one is gone."""
    before = getattr(env, "gpbnb_outputs", None)
    if before is None and not removed:
        return []
    lay_copies(app)
    return [] if before == app.config.gpbnb_outputs and not removed else sorted(env.found_docs)


def remove_old_pages(app: Sphinx, error: Exception | None) -> None:
    """Remove pages whose source is gone: Sphinx leaves them where they are."""
    if error or app.builder.name != "html":
        return
    root = Path(app.outdir)
    kept = {app.builder.get_target_uri(name) for name in app.env.found_docs}
    kept |= {f"{name}.html" for name in ("index", "search", "py-modindex", "_modules/index")}
    kept |= {f"_modules/{name.replace('.', '/')}.html" for name in getattr(app.env, "_viewcode_modules", {})}
    for page in root.rglob("*.html"):
        name = page.relative_to(root).as_posix()
        if name not in kept and not name.startswith("_static/"):
            page.unlink()


def setup(app: Sphinx) -> dict:
    sources = sorted(Path(__file__).parent.glob("*.py"))
    state = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()
    app.add_config_value("gpbnb_extensions", state, "env")  # a change of them changes any page
    app.add_config_value("gpbnb_outputs", "", "")
    app.connect("builder-inited", execute)
    # The trees of all pages are large, and hardly any of their nodes become garbage.
    app.connect("builder-inited", lambda app: gc.disable())
    app.connect("build-finished", lambda app, error: gc.enable())
    app.connect("source-read", use_copy)
    app.connect("env-get-outdated", outdated)
    app.connect("env-before-read-docs", keep_numbers, priority=900)
    app.connect("env-get-updated", number_read_trees, priority=100)
    app.connect("env-get-updated", renumbered, priority=900)
    app.connect("env-updated", keep_contents)
    app.connect("env-updated", write_in_parallel)
    app.connect("build-finished", remove_old_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
