"""Docstrings are noun phrases or begin with a verb: none is a question or a relative clause."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
QUESTIONS = ("What", "How", "Which", "Whether", "Where", "Who", "When")
FILES = [path for package in ("daq", "oma", "updater", "monitor") for path in sorted((ROOT / package).rglob("*.py"))]


def first_words(source: str) -> list[tuple[int, str]]:
    """Return the line and the first word of each docstring."""
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    nodes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds)]
    texts = [(getattr(node, "lineno", 1), ast.get_docstring(node)) for node in nodes]
    return [(line, text.split(maxsplit=1)[0]) for line, text in texts if text]


def test_question_word_at_start_of_docstring_is_detected() -> None:
    assert first_words('def f():\n    """What is asked."""\n') == [(1, "What")]


@pytest.mark.parametrize("package", ["daq", "oma", "updater", "monitor"])
def test_no_docstring_begins_with_a_question_word(package: str) -> None:
    found = []
    for path in FILES:
        if path.relative_to(ROOT).parts[0] == package:
            words = first_words(path.read_text(encoding="utf-8"))
            found += [f"{path.relative_to(ROOT)}:{line}" for line, word in words if word in QUESTIONS]
    assert found == []
