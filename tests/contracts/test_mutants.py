"""Mutants of `make mutants`: changes of a source, and whether the table of tests and exceptions is up to date."""

import ast
import tomllib

import pytest

from tests.mutants.made import mutants, mutated
from tests.mutants.run import ROOT, TABLE

SOURCE = '''"""Text."""
LIMIT: int | None = 3


@lru_cache(maxsize=8)
def scaled(x: float, *, by: float = 2.0) -> float:
    """Return 1 + 1."""
    if not x <= LIMIT:
        raise ValueError(f"expected at most {LIMIT + 1}, found {x}")
    if -x > 4:
        x += 1
    return max(x * by, 0.0)
'''
CHANGES = {
    2: ["3 -> 4"],
    6: ["2.0 -> 4.0"],
    8: ["if not x <= LIMIT: -> if x <= LIMIT:", "not x <= LIMIT -> x <= LIMIT", "x <= LIMIT -> x < LIMIT"],
    9: ["raise ValueError(f'expected at most {LIMIT + 1}, found {x}') -> pass"],
    10: ["if -x > 4: -> if not -x > 4:", "-x > 4 -> -x >= 4", "-x -> x", "4 -> 5"],
    11: ["x += 1 -> pass", "1 -> 2"],
    12: [
        "return max(x * by, 0.0) -> return None",
        "max(x * by, 0.0) -> min(x * by, 0.0)",
        "x * by -> x / by",
        "0.0 -> 1.0",
    ],
}


def test_mutants_are_made_once_and_skip_texts_annotations_and_decorators() -> None:
    found: dict[int, list[str]] = {}
    for mutant in mutants("m.py", SOURCE):
        found.setdefault(mutant.line, []).append(mutant.change)
    assert found == CHANGES


def test_mutant_differs_from_source_in_one_line() -> None:
    plain = ast.unparse(ast.parse(SOURCE)).splitlines()
    for mutant in mutants("m.py", SOURCE):
        changed = mutated(SOURCE, mutant.number).splitlines()
        assert len(changed) == len(plain)
        assert sum(a != b for a, b in zip(plain, changed, strict=True)) == 1
        assert mutant.line in mutant.lines


def test_files_and_lines_in_mutant_table_exist() -> None:
    table = tomllib.loads(TABLE.read_text())
    for module, files in table["tests"].items():
        assert (ROOT / module).is_file()
        assert [file for file in files if not (ROOT / file).is_file()] == []
    for mutant in table["equivalent"]:
        lines = {line.strip() for line in (ROOT / mutant["module"]).read_text().splitlines()}
        assert mutant["text"] in lines, f"{mutant['module']}: {mutant['text']}"
        assert mutant["reason"]


def test_equal_mutants_in_one_line_are_numbered() -> None:
    assert [m.change for m in mutants("m.py", "x = 1, 1\n")] == ["1 -> 2", "1 -> 2 (2)"]


@pytest.mark.parametrize(
    "source", ["f(a, strict=True)\n", '"""Text."""\n', "class A(B, n=1): ...\n", "x: int | None\n"]
)
def test_source_parts_without_effect_are_not_mutated(source: str) -> None:
    assert [m.change for m in mutants("m.py", source) if not m.change.endswith("-> pass")] == []
