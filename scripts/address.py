"""Write the address of the project, which pyproject.toml holds, into README.md, CITATION.cff and CONTRIBUTING.md.

The address stands in one place: `Repository` under `[project.urls]` in pyproject.toml. Without it, the texts speak of
"your clone", and name no tracker. `make address` writes them; the book takes them from here, through
`book/_ext/gpbnb_address.py`.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from urllib.parse import urlsplit

ROOT = Path(__file__).resolve().parents[1]
LINK = re.compile(r"\[([^\]]*)\]\(([^)]*)\)|<(https?:[^>]*)>")
"""A link with its text, or an address that stands for itself."""
FILES = ("README.md", "CITATION.cff", "CONTRIBUTING.md")
# A marked part: <!-- address: NAME --> … <!-- end --> in Markdown, and lines from # address: NAME to # end elsewhere.
MARKED = re.compile(
    r"(?P<open><!-- address: (?P<name>\w+) -->\n?|^# address: (?P<other>\w+)\n)"
    r"(?P<text>.*?)(?P<close><!-- end -->|^# end$)",
    re.DOTALL | re.MULTILINE,
)


def read(file: Path = ROOT / "pyproject.toml") -> str:
    """Return the address of the project without a slash at the end; empty if none is set.

    Raises
    ------
    ValueError : the address is no web address.
    """
    given = tomllib.loads(file.read_text(encoding="utf-8"))["project"].get("urls", {}).get("Repository", "").strip()
    parts = urlsplit(given)
    if given and (parts.scheme not in ("http", "https") or not parts.netloc or parts.query or parts.fragment):
        raise ValueError(f"got the address {given!r}; needed one such as https://example.org/gpbnb")
    return given.rstrip("/")


def phrases(address: str) -> dict[str, str]:
    """Return the texts that depend on the address, by name; code stands in a block of its own."""
    if not address:
        return {
            "clone": "your clone of the project",
            "install": "python -m pip install .    # in your clone",
            "help": "Ask questions and report errors where you got your clone.",
            "citation": "",
            "url": "",
        }
    return {
        "clone": f"a clone of <{address}>",
        "install": f"python -m pip install git+{address}",
        "help": f"Ask questions and report errors in the [issue tracker]({address}/issues).",
        "citation": f'repository-code: "{address}"\n',
        "url": f"  url     = {{{address}}},\n",
    }


def written(text: str, address: str) -> str:
    """Return a text with its marked parts as the address asks for."""
    found = phrases(address)

    def part(match: re.Match[str]) -> str:
        name = match["name"] or match["other"]
        body = found[name]
        if name == "install":
            body = f"```sh\n{body}\n```\n"
        return f"{match['open']}{body}{match['close']}"

    return MARKED.sub(part, text)


def main() -> int:
    """Write the address into each file."""
    address = read()
    for name in FILES:
        path = ROOT / name
        path.write_text(written(path.read_text(encoding="utf-8"), address), encoding="utf-8")
    print(f"The texts name {address}." if address else 'pyproject.toml names no address: the texts say "your clone".')
    return 0


if __name__ == "__main__":
    sys.exit(main())
