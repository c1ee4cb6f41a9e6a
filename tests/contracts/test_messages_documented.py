"""Every error message that a user can meet has an entry in the pages of troubleshooting, and every entry a message."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import daq.errors
import monitor.errors
import oma.errors
import updater.errors
from monitor.outputs.history.engines import HistoryError

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "docs" / "faq.md", *sorted((ROOT / "docs" / "troubleshooting").glob("*.md"))]
ROOTS = (
    daq.errors.DaqError,
    oma.errors.OmaError,
    updater.errors.UpdaterError,
    monitor.errors.MonitorError,
    HistoryError,
)
PACKAGES = ("daq", "oma", "updater", "monitor")
MIN_WORDS = 2  # of a message without its variable parts; others are prefixes to the message of another error
VALUE = "\N{HORIZONTAL ELLIPSIS}"  # in place of a variable part
#: they reach a user, if at all, only as a part of one of the messages above
INTERNAL = {"emulator", "protocol", "types.py", "detection", "rig"}


def names_of(kinds: tuple[type[Exception], ...]) -> Iterator[str]:
    for kind in kinds:
        yield kind.__name__
        yield from names_of(tuple(kind.__subclasses__()))


#: of other libraries and of Python, raised for a user; and errors that one of ours repeats
OTHERS = {
    "BLFParseError",
    "CanOperationError",
    "CodecError",
    "McapError",
    "NoticeError",
    "ProofError",
    "SerialException",
}
USERS = {*names_of(ROOTS), *OTHERS, "TemplateFailure", "UnevenError", "ValueError"}


def text_of(node: ast.expr) -> str:
    """Return the text of an argument, variable parts as an ellipsis."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(text_of, parts))
        case ast.BinOp(left=left, right=right):
            return text_of(left) + text_of(right)
        case _:
            return VALUE


@cache
def sources() -> dict[Path, str]:
    """Return the text of every module."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    return {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in paths}


def messages() -> Iterator[tuple[str, str]]:
    """Yield the place and the text of every message that is raised for a user."""
    for path, source in sources().items():
        if "raise" in source and not INTERNAL & set(path.parts):
            for node in ast.walk(ast.parse(source)):
                if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                    text = ": ".join(map(text_of, node.exc.args))
                    words = re.findall(r"[a-z]{2,}", text)
                    if getattr(node.exc.func, "id", "") in USERS and len(words) >= MIN_WORDS:
                        yield f"{path}:{node.lineno}", text


def entries() -> list[str]:
    """Return the messages of the pages; `..` is a variable part."""
    rows = [line for page in PAGES for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    return [re.split("`+ [|]", row)[0].removeprefix("| ").strip("` ") for row in rows]


def test_every_message_has_an_entry() -> None:
    parts = [map(re.escape, re.split(r"\s*\.\.\s*", entry)) for entry in entries()]
    known = [re.compile(".*".join(constant), re.DOTALL) for constant in parts]
    assert [f"{at}: {text}" for at, text in messages() if not any(k.search(text) for k in known)] == []


def test_every_entry_is_a_message() -> None:
    joined = re.sub(r"[\"']\s*\n\s*f?[\"']", "", "\n".join(sources().values()))
    longest = {entry: max(re.split(r"\s*\.\.\s*|: ", entry), key=len) for entry in entries()}
    assert [entry for entry, part in longest.items() if part not in joined and not entry.startswith("No such")] == []
