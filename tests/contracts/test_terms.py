"""Texts for users are in plain technical English: words that docs/reference/terms.md excludes are in none of them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from monitor.cli.commands import COMMANDS, command_function

ROOT = Path(__file__).parents[2]
BANNED = re.compile(
    r"\b(told|said|says?|tells?|hears?|heard|beside|nobody|somebody|befell|mend(ed|s)?|hung|hangs?|odds"
    r"|unless given|gives? way|goes? on|left over|answers? to|sees?|asks?|asked|knows?|stands)\b"
)
ALLOWED = {"a type that this codec knows", "the devices answer; see the problems above"}
PACKAGES = ("daq", "oma", "updater", "monitor")


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the line and the text of every string with a space that is no docstring of a module, class or function."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
    for node in strings:
        text = str(node.value)
        if id(node) not in docs and (" " in text.strip() or text == "stands") and text not in ALLOWED:
            yield node.lineno, text


@pytest.mark.parametrize("package", PACKAGES)
def test_texts_for_users_have_no_banned_words(package: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text[:80]}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for line, text in texts(path)
        if BANNED.search(text)
    ]
    assert found == []


@pytest.mark.parametrize("path", COMMANDS)
def test_help_of_commands_has_no_banned_words(path: str) -> None:
    assert not BANNED.search(command_function(path).__doc__ or "")
