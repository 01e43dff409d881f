"""Write one page of the API reference for each public module, and remove pages whose module is gone."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "book" / "api"
# Programs that a reader copies and reads whole; a listing of one this dense would weigh more than any page.
COPIED = ("gpbnb.bounds.check",)


def public_modules() -> dict[str, str]:
    """Dotted name → first line of the docstring of each public module; checks and kernels are left out."""
    found = {}
    for path in sorted((ROOT / "gpbnb").rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        tree = ast.parse(path.read_text(encoding="utf-8"))
        defines = any(isinstance(node, ast.FunctionDef | ast.ClassDef) for node in tree.body)
        if defines and not any(part.startswith("_") for part in parts) and not {"checks", "kernels"} & set(parts):
            found[".".join(parts)] = (ast.get_docstring(tree) or "").splitlines()[0]
    return found


def page(module: str) -> str:
    title = module.removeprefix("gpbnb.")
    described = f"# `{title}`\n\n```{{eval-rst}}\n.. automodule:: {module}\n"
    if module in COPIED:
        path = f"{module.replace('.', '/')}.py"
        return f"{described}```\n\nThe whole program: {{download}}`{Path(path).name} <../../{path}>`.\n"
    return f"{described}   :members:\n```\n"


def main() -> None:
    PAGES.mkdir(exist_ok=True)
    modules = public_modules()
    for old in PAGES.glob("*.md"):
        if old.stem not in modules:
            old.unlink()
    for module in modules:
        (PAGES / f"{module}.md").write_text(page(module), encoding="utf-8")
    print(f"{len(modules)} pages in {PAGES.relative_to(ROOT)}")


if __name__ == "__main__":
    sys.exit(main())
