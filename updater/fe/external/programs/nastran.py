"""Bulk data of Nastran: cards, and the matrices of DMIG entries, as of punch files.

References
----------
MSC Nastran quick reference guide: bulk data entry DMIG.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from updater.errors import StructureError
from updater.fe.external.programs.numbers import LabelledMatrix, Row, checked_rows, labelled

REAL = {1: 1, 2: 2}  #: type of numbers -> words of 4 bytes of a number


def chosen(path: Path, names: Sequence[str], initial: str) -> int:
    """Return which of several matrices is meant: the first with a name of this initial."""
    named = [k for k, name in enumerate(names) if name.upper().startswith(initial)]
    if len(names) > 1 and not named:
        raise StructureError(path, f"expected a matrix with a name in {initial}, found {', '.join(names)}"[:200])
    return named[0] if named else 0


def is_dmig(lines: Sequence[str]) -> bool:
    """Return whether lines have DMIG entries."""
    return any(line[:4].upper() == "DMIG" for line in lines)


def read_dmig(path: Path, lines: Sequence[str], initial: str) -> LabelledMatrix:
    """Read a matrix of DMIG entries, of a punch file or of a bulk data file.

    Parameters
    ----------
    path, lines : file and its lines
    initial : of the name of the matrix that is meant, if there are several

    Raises
    ------
    StructureError
        Naming the file, and the matrix or the entry.
    """
    headers: list[list[str]] = []
    columns: list[list[str]] = []
    for card in bulk_cards(lines):
        if card[0] == "DMIG":
            fields = [*card[1:], "", "", ""]
            (headers if fields[1] == "0" else columns).append(fields)
    square = [card for card in headers if card[2] in ("1", "6")]
    if not square:
        raise StructureError(path, "holds no square matrix (DMIG with form 1 or 6)")
    header = square[chosen(path, [card[0] for card in square], initial)]
    name = header[0]
    if header[3] not in map(str, REAL):
        raise StructureError(path, "expected a real matrix")
    ends = list[tuple[Row, Row]]()
    values: list[float] = []
    for card in columns:
        if card[0] != name:
            continue
        to = _dof(path, card[1:3])
        for k in range(4, len(card) - 3, 4):
            node, axis, value, _ = card[k : k + 4]
            if node:
                ends.append((_dof(path, (node, axis)), to))
                values.append(_number(path, value))
    rows = checked_rows(path, sorted({row for both in ends for row in both}))
    place = {row: i for i, row in enumerate(rows)}
    row, column = ([place[both[k]] for both in ends] for k in (0, 1))
    return labelled(path, name, row, column, values, rows)


def _dof(path: Path, words: Sequence[str]) -> Row:
    if not all(word.isdecimal() for word in words):
        raise StructureError(path, f"DMIG: expected a node and a degree of freedom, found {' '.join(words)!r:.40}")
    return int(words[0]), int(words[1]) - 1  # 0: a scalar point


def _number(path: Path, word: str) -> float:
    try:
        return float(nastran_number(word))
    except ValueError as error:
        raise StructureError(path, f"DMIG: expected a number, found {word!r:.40}") from error


def bulk_cards(lines: Sequence[str]) -> Iterator[list[str]]:
    """Yield the fields of each card of the bulk data, continuations joined."""
    card: list[str] = []
    for line in (line.partition("$")[0].rstrip() for line in lines):
        if not line:
            continue
        fields = _fields(line)
        continued = not fields[0] or fields[0][0] in "+*"
        if continued and card:
            card += fields[1:]
            continue
        if card:
            yield card
        card = [fields[0].rstrip("*").upper(), *fields[1:]]
    if card:
        yield card


def _fields(line: str) -> list[str]:
    """Return the name of a card and its fields, without that of the continuation."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        count = 5 if "*" in words[0] else 9
        return [*words, *[""] * count][:count]
    line = line.expandtabs()
    wide = "*" in line[:8]
    size, count = (16, 4) if wide else (8, 8)
    own = [line[8 + size * k : 8 + size * (k + 1)].strip() for k in range(count)]
    return [line[:8].strip(), *own]


def nastran_number(word: str) -> str:
    """Return a number such as 1.5-3 with the exponent's letter."""
    text = word.upper().replace("D", "E") or "0"
    for sign in "+-":
        head, found, tail = text[1:].rpartition(sign)
        if found and head and head[-1] != "E" and tail.isdecimal():
            return f"{text[0]}{head}E{sign}{tail}"
    return text
