"""Warn of replaced words in identifiers and in the text that people read: ``make lint`` calls it.

``scripts/replaced_words.csv`` lists the words, and what to use instead.
"""

import ast
import csv
import io
import json
import re
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REPLACED = list(csv.DictReader((ROOT / "scripts" / "replaced_words.csv").read_text(encoding="utf-8").splitlines()))
CODE = sorted([*(ROOT / "gpbnb").rglob("*.py"), *(ROOT / "benchmarks").glob("*.py"), *(ROOT / "scripts").glob("*.py")])
TEXT = sorted([*(ROOT / "book").glob("*.md"), *(ROOT / "book").glob("*.ipynb"), *ROOT.glob("*.md")])
NOT_PROSE = re.compile(r"```.*?```|\$\$.*?\$\$|\$[^$]*\$|`[^`]*`|\]\([^)]*\)", re.DOTALL)


def identifiers(path):
    """Names that a file defines: functions, classes, arguments, variables and attributes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id


def words_of(name):
    """The words of an identifier in lower case: ``BoundStatistics`` has bound and statistics."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}


def prose(path):
    """What people read of a file: Markdown, captions and alternative texts; docstrings and comments of code."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return NOT_PROSE.sub(" ", text)
    if path.suffix == ".ipynb":
        parts = []
        for cell in json.loads(text)["cells"]:
            figure = cell["metadata"].get("mystnb", {})
            parts += [figure.get("figure", {}).get("caption", ""), figure.get("image", {}).get("alt", "")]
            if cell["cell_type"] == "markdown":
                parts.append("".join(cell["source"]))
        return NOT_PROSE.sub(" ", "\n\n".join(parts))
    tree = ast.parse(text)
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, documented)]
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = [token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT]
    return NOT_PROSE.sub(" ", "\n\n".join([*docstrings, *comments]))


def replaced(where):
    return [row for row in REPLACED if row["where"] in (where, "both")]


def old_identifiers(path):
    """The names of a file that have a replaced word, and the word to use instead."""
    old = {row["word"]: row["use"] for row in replaced("identifiers")}
    return {name: old[word] for name in identifiers(path) for word in words_of(name) & set(old)}


def old_words(path):
    """The replaced words in the text of a file, and the words to use instead."""
    text = " ".join(prose(path).split())
    return {
        match[0]: row["use"]
        for row in replaced("prose")
        for match in re.finditer(rf"\b(?:{row['word']})\b", text, re.IGNORECASE)
    }


def main():
    """Print a warning for each replaced word; a warning fails nothing."""
    count = 0
    for path in [*CODE, *TEXT]:
        found = old_words(path) | (old_identifiers(path) if path.suffix == ".py" else {})
        for word, use in sorted(found.items()):
            print(f"warning: {path.relative_to(ROOT)}: got {word!r}; needed {use!r}")
        count += len(found)
    print(f"vocabulary: {count or 'no'} warnings in {len(CODE) + len(TEXT)} files")


if __name__ == "__main__":
    main()
