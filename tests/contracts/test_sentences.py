"""Sentences for users are made in monitor/text: `updater` returns values."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

UPDATER = Path(__file__).parents[2] / "updater"
MIN_SPACES = 3  # of a sentence; shorter texts are names
ATTRIBUTES = {"advice", "instrument"}  # supplied with a cause by its author
CALLS = {"attempt", "debug", "warning"}  # log, and names of the parts that an internal fault leaves out
#: messages of errors that are raised, or logged, elsewhere; names of parameters; titles and axes of figures
MESSAGES = {"causes/catalogue.py", "modal_data/tracked.py", "fe", "structure", "diagnosis/schema/figures.py"}


def spaces(node: ast.AST) -> int:
    """Return the number of spaces of a string, or of all constant parts of an f-string."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return sum(p.value.count(" ") for p in parts if isinstance(p, ast.Constant) and isinstance(p.value, str))


def skipped(node: ast.AST) -> bool:
    """Return whether sentences may be in a node: an error, a docstring, a log message, a cause's attribute."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Attribute) and node.func.attr in CALLS
    if isinstance(node, ast.Assign | ast.AnnAssign):
        target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
        return isinstance(target, ast.Name) and target.id in ATTRIBUTES
    return isinstance(node, ast.Raise) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))


def sentences(node: ast.AST) -> Iterator[str]:
    """Yield line and source of each sentence under a node."""
    if spaces(node) >= MIN_SPACES:
        yield f"{getattr(node, 'lineno', 0)}: {ast.unparse(node)[:80]}"
        return
    for child in ast.iter_child_nodes(node):
        if not skipped(child):
            yield from sentences(child)


@pytest.mark.parametrize(
    "source",
    [
        'text = "fits, but no change fits as well"',
        'def f(x):\n    return f"{x} g at {x} m of {x}"',
        'class Mass:\n    reason: str = "there is no better cause"',
    ],
)
def test_sentence_is_recognised(source: str) -> None:
    assert list(sentences(ast.parse(source)))


def test_updater_composes_no_sentences() -> None:
    paths = [
        path for path in UPDATER.rglob("*.py") if not MESSAGES & {(p := path.relative_to(UPDATER)).parts[0], str(p)}
    ]
    assert len(paths) > 50
    found = [
        f"{path.relative_to(UPDATER)}:{sentence}"
        for path in sorted(paths)
        for sentence in sentences(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == []
