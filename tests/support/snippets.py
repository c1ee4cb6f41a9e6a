"""Code of notebooks and pages, run as a notebook runs it."""

import ast
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure


def code_cells(path: Path) -> list[str]:
    """Return the code of a notebook, without commands to IPython."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return [_without_commands(source) for source in sources]


def code_blocks(page: Path) -> list[str]:
    """Return the blocks of Python in a page, without commands to IPython."""
    return [_without_commands(source) for source in _fenced(page, "python")]


def shell_lines(page: Path) -> list[str]:
    """Return the commands of the blocks of shell commands in a page, each in one line."""
    blocks = (block.replace("\\\n", "") for block in _fenced(page, "sh"))
    return [line for block in blocks for line in block.splitlines() if line.strip()]


def named_files(page: Path) -> dict[str, str]:
    """Return the files that a page shows: blocks whose first line is a comment with the name of the file."""
    blocks = {block.partition("\n")[0].removeprefix("# "): block for block in _fenced(page, "toml")}
    return {name: text for name, text in blocks.items() if re.fullmatch(r"\w+\.toml", name)}


def _fenced(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def _without_commands(source: str) -> str:
    return "\n".join(line for line in source.splitlines() if not line.startswith("%"))


def run_cells(cells: Iterable[str], **given: object) -> dict[str, Any]:
    """Run pieces of code in one namespace; what each ends in is shown as a notebook shows it. Return the namespace."""
    namespace: dict[str, Any] = {"__name__": "__main__", **given}
    for cell in cells:
        tree = ast.parse(cell)
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "<cell>", "exec"), namespace)
        if isinstance(last, ast.Expr):
            _show(eval(compile(ast.Expression(last.value), "<cell>", "eval"), namespace))
    return namespace


def _show(value: object) -> None:
    if isinstance(value, Figure):
        value.draw_without_rendering()
    elif hasattr(value, "_repr_html_"):
        assert value._repr_html_().startswith(("<table", "<div"))
    else:
        repr(value)
