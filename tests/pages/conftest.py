from __future__ import annotations

from contextlib import ExitStack, contextmanager

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
def browser():
    with tools.launch() as launched:
        yield launched


@pytest.fixture(scope="session")
def open_page(browser):
    """Open a page of the book and wait for its formulas, if it does not lead elsewhere; `page.faults` collects.

    Pages have their own settings and cache, unless they are `shared`: then scripts and fonts are loaded once.
    """
    with tools.serve() as base:
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


@pytest.fixture(scope="session")
def look_at(open_page):
    """A function that shows a page as on a desktop, on a phone or on paper; the last page stays open.

    A narrow window stands for a phone, and one of the tests compares the two. A printed page is opened anew.
    """
    with ExitStack() as opened:
        shown = None

        def look_at(address, look):
            nonlocal shown
            if shown is None or shown[0] != address or shown[2] == "paper":
                opened.close()
                page = opened.enter_context(open_page(address))
                page.times = page.evaluate(tools.TIMES)
                shown = address, page, "desktop"
            _, page, before = shown
            if look != before:
                page.emulate_media(color_scheme="light")
                page.set_viewport_size(tools.SIZES["desktop" if look == "paper" else look])
                page.evaluate(tools.RESTED)
            if look == "paper":
                page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
                page.set_viewport_size(tools.PAPER)
                page.emulate_media(media="print")
                page.evaluate(tools.RESTED)
            shown = address, page, look
            return page

        yield look_at


# Of the session, so that pytest lets all tests of one address follow each other.
@pytest.fixture(scope="session", params=[(a, s) for a in tools.pages() for s in tools.SIZES], ids="-".join)
def page(request, look_at):
    return look_at(*request.param)
