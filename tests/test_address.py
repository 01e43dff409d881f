"""The address of the project: one setting, named wherever a reader needs it; without it, no text pretends."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
import address  # noqa: E402

SET = "https://example.org/gpbnb"


def texts(setting):
    return {name: address.written((ROOT / name).read_text(encoding="utf-8"), setting) for name in address.FILES}


def test_the_files_are_written_for_the_address_that_is_set():
    assert texts(address.read()) == {name: (ROOT / name).read_text(encoding="utf-8") for name in address.FILES}


def test_an_address_reaches_install_line_tracker_and_citation():
    found = texts(SET)
    assert f"```sh\npython -m pip install git+{SET}\n```" in found["README.md"]
    assert f"[issue tracker]({SET}/issues)" in found["README.md"]
    assert f"[issue tracker]({SET}/issues)" in found["CONTRIBUTING.md"]
    assert f'\nrepository-code: "{SET}"\n' in found["CITATION.cff"]
    assert not any("in your clone" in text or "got your clone" in text for text in found.values())
    assert all(address.written(text, SET) == text for text in found.values())
    assert all(address.written(text, address.read()) == texts(address.read())[name] for name, text in found.items())


def test_without_an_address_no_text_names_one():
    for name, text in texts("").items():
        assert "issue tracker](" not in text, name
        assert "repository-code" not in text, name
        assert "git+" not in text, name
    assert "python -m pip install .    # in your clone" in texts("")["README.md"]


def test_no_other_place_names_a_repository():
    """Pages of the book take the address from the setting, too."""
    pages = [*(ROOT / "book").glob("*.md"), *(ROOT / "book").glob("*.ipynb")]
    for page in pages:
        assert not re.search(r"pip install (?:\.|git\+)", page.read_text(encoding="utf-8")), page.name


@pytest.mark.parametrize("given", ["example.org/gpbnb", "ftp://example.org/x", "https://example.org/x?y=1", "https://"])
def test_what_is_no_web_address_is_refused(tmp_path, given):
    file = tmp_path / "pyproject.toml"
    file.write_text(f'[project]\n[project.urls]\nRepository = "{given}"\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"needed one such as https://example.org/gpbnb"):
        address.read(file)
    file.write_text(f'[project]\n[project.urls]\nRepository = "{SET}/"\n', encoding="utf-8")
    assert address.read(file) == SET
    file.write_text("[project]\n", encoding="utf-8")
    assert address.read(file) == ""


def test_a_link_of_a_phrase_is_found():
    links = [address.LINK.search(address.phrases(SET)[name]) for name in ("clone", "help")]
    assert [link[2] or link[3] for link in links] == [SET, f"{SET}/issues"]
