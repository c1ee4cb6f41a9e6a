"""Text from files of others: TOML and JSON of bounded size and depth, names that were meant, text safe to print."""

import difflib
import json
import re
import tomllib
import unicodedata
from collections.abc import Iterable
from typing import Any

_MAX_CHARACTERS = 64_000_000  # of a text that is parsed
_MAX_DEPTH = 64  # of tables and lists
_MAX_INTEGER = (1 << 64) - 1  # times and counters are less
_MAX_LINE = 1000  # characters of an error
_MIN_BEGINNING = 2  # letters of a word from which on they represent it
_TAIL = 250  # of them from the end of the text
_UNSAFE = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")  # Unicode categories: control, bidirectional, surrogate, ...


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text.

    Raises
    ------
    ValueError
        If it is no TOML, too large, nested too deeply, or holds an integer of more than 64 bits.
    """
    _check_size(text)
    try:
        content = tomllib.loads(text)
    except RecursionError as error:
        raise ValueError(_TOO_DEEP) from error
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{error}{_quotes_hint(text, str(error))}{_comma_hint(text, str(error))}") from error
    _check_values(content)
    return content


def _quotes_hint(text: str, error: str) -> str:
    """Return that a bare word needs quotes, if the error of a TOML text is one; true and false are lower case."""
    place = re.fullmatch(r"Invalid value \(at line (\d+), column (\d+)\)", error)
    word = place and re.match(r"[^\W\d][\w-]*", text.split("\n")[int(place[1]) - 1][int(place[2]) - 1 :])
    if not word:
        return ""
    if (lower := word[0].lower()) in {"true", "false"}:
        return f": write {lower}"
    return f': a text needs quotes: "{word[0]}"'


def _comma_hint(text: str, error: str) -> str:
    """Return that the decimal sign is a point, if the error of a TOML text is the comma in a number."""
    place = re.fullmatch(
        r"Expected newline or end of document after a statement \(at line (\d+), column (\d+)\)", error
    )
    line, column = (text.split("\n")[int(place[1]) - 1], int(place[2]) - 1) if place else ("", 0)
    return (
        ": the decimal sign is a point" if re.search(r"\d$", line[:column]) and re.match(r",\d", line[column:]) else ""
    )


def parse_json(text: str | bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Return the value of a JSON text; errors as for `parse_toml`."""
    _check_size(text)
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise ValueError(_TOO_DEEP) from error
    _check_values(content)
    return content


def meant(word: str, known: Iterable[str]) -> str:
    """Return the question whether another word was meant: one that is cut short, or spelt nearly so, in any case.

    Of dotted words the last part is compared with a word without a dot.
    """
    by_lower: dict[str, str] = {}
    for name in known:
        by_lower.setdefault((name if "." in word else name.rpartition(".")[2]).lower(), name)
    begun = [name for name in by_lower if len(word) >= _MIN_BEGINNING and name.startswith(word.lower())]
    near = [min(begun, key=len)] if begun else difflib.get_close_matches(word.lower(), by_lower, 1)
    return f", did you mean {by_lower[near[0]]!r}?" if near else ""


_TOO_DEEP = f"expected tables and lists nested up to {_MAX_DEPTH} deep, found more"


def _check_size(text: str | bytes) -> None:
    if len(text) > _MAX_CHARACTERS:
        raise ValueError(f"expected up to {_MAX_CHARACTERS} characters, found {len(text)}")


def _check_values(content: object) -> None:
    """Refuse containers nested too deeply, and integers that no array and no database takes."""
    level: list[object] = [content]
    for _ in range(_MAX_DEPTH):
        inner: list[object] = []
        for value in level:
            if isinstance(value, dict):
                inner += value.values()
            elif isinstance(value, list):
                inner += value
            elif isinstance(value, int) and abs(value) > _MAX_INTEGER:
                raise ValueError(f"expected integers of up to 64 bits, found one of {value.bit_length()}")
        if not inner:
            return
        level = inner
    raise ValueError(_TOO_DEEP)


def printable(text: str) -> str:
    """Return a text with control characters written as escapes, except tabs and line breaks.

    Escape sequences in a name could otherwise move the cursor, change colours or titles, and hide text.
    """
    if text.isprintable():
        return text
    return "".join(character if _is_safe(character) else _escaped(character) for character in text)


def _is_safe(character: str) -> bool:
    return character in "\n\t" or unicodedata.category(character) not in _UNSAFE


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def one_line(text: str) -> str:
    """Return a printable text as one line of bounded length; of a longer one the beginning and the end."""
    line = printable(" ".join(text.split("\n")))
    if len(line) <= _MAX_LINE:
        return line
    return f"{line[: _MAX_LINE - _TAIL]} ... ({len(line) - _MAX_LINE} characters left out) ... {line[-_TAIL:]}"
