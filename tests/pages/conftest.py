from __future__ import annotations

from contextlib import contextmanager

import pytest

from . import browser as tools

MISSING = tools.missing()


class Skipped(pytest.Module):
    """A file of page tests, where they cannot be run."""

    def collect(self):
        pytest.skip(f"the page tests need more: {MISSING}", allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    return Skipped.from_parent(parent, path=module_path) if MISSING else None


@pytest.fixture(scope="session")
def open_page():
    """Open a page of the book and wait for its formulas, if it does not lead elsewhere; `page.faults` collects.

    Pages have their own settings and cache, unless they are `shared`: then scripts and fonts are loaded once.
    """
    with tools.serve() as base, tools.launch() as browser:
        contexts = {}

        def new_context(size):
            return browser.new_context(viewport=tools.SIZES[size], reduced_motion="reduce")

        @contextmanager
        def open_page(address, size="desktop", shared=False):
            if shared and size not in contexts:
                contexts[size] = new_context(size)
            context = contexts[size] if shared else new_context(size)
            page = context.new_page()
            page.faults = faults = []
            page.on("console", lambda m: faults.append(f"console: {m.text}") if m.type == "error" else None)
            page.on("pageerror", lambda error: faults.append(f"script: {error}"))
            page.on("request", lambda r: None if r.url.startswith((base, "data:", "blob:")) else faults.append(r.url))
            # Whoever leaves a page aborts what it still loads: no fault of the page.
            page.on(
                "requestfailed",
                lambda r: None if r.failure == "net::ERR_ABORTED" else faults.append(f"failed: {r.url} {r.failure}"),
            )
            page.on("response", lambda r: faults.append(f"{r.status}: {r.url}") if r.status >= 400 else None)
            page.goto(base + address, wait_until="load")
            if address:
                page.evaluate(tools.SETTLED)
            yield page
            (page if shared else context).close()

        yield open_page


# One page is opened at a time, and serves all tests of it.
@pytest.fixture(scope="module", params=[(a, s) for a in tools.opened() for s in tools.SIZES], ids="-".join)
def page(request, open_page):
    with open_page(*request.param, shared=True) as page:
        yield page


@pytest.fixture(scope="session")
def axe():
    from axe_playwright_python.sync_playwright import Axe

    return Axe()
