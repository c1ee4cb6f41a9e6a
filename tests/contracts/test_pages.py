"""Pages of the documentation: their length, their commands and files, and the keys of JSON that they name."""

import ast
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from monitor.cli.commands import COMMANDS, GROUPS, command

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md"]
MAX_WORDS, MAX_ENTRIES, MAX_README_LINES = 1200, 14, 120
#: where commands make the JSON of docs/reference/json/commands.md, with the functions that have its keys
JSON = {
    "data/identify/identification_output.py": ("as_json", "_change_json", "_mode_json", "mode_json"),
    "data/identify/response_modes.py": ("_as_json", "_mass_json"),
    "data/structure/structure_output.py": ("as_json", "_body", "_places", "_target", "_set"),
    "data/structure/parameters_output.py": ("parameters_json",),
    "data/body_selection.py": ("bodies_json",),
    "logs/summary.py": ("as_json", "_device_json"),
    "logs/repetition.py": ("replay_log",),
    "operation/history_output.py": ("as_json",),
    "site/commissioning.py": ("as_json",),
    "site/device_search.py": ("_as_json",),
}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks_of(page: Path) -> list[tuple[str, str]]:
    """Return language and content of the fenced and of the indented blocks of code."""
    text = page.read_text(encoding="utf-8")
    fenced = re.findall(r"^(?: *)```(\w*)\n(.*?)^(?: *)```$", text, re.MULTILINE | re.DOTALL)
    without = re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)
    return [*fenced, *(("", block) for block in re.findall(r"(?:^ {4,}\S.*\n)+", without, re.MULTILINE))]


def commands_of(page: Path) -> list[str]:
    """Return the lines that call the program, without comments and what is to the right of them."""
    blocks = [re.sub(r"\\\n\s*", "", block) for language, block in blocks_of(page) if language != "toml"]
    lines = [line.strip() for block in blocks for line in block.splitlines()]
    lines = [re.sub(r"\s+#.*|\s{3,}.*", "", re.sub(r"^(\$|sudo) ", "", line)) for line in lines]
    return [line for line in lines if line.startswith("modalwatch ")]


def parse(line: str) -> None:
    """Parse a line as the program does; raises for an unknown command, option or value."""
    words = shlex.split(line.partition(" > ")[0])[1:]
    if words[0].startswith("--"):
        return
    n = 2 if words[0] in GROUPS else 1
    path = " ".join(words[:n])
    assert path in COMMANDS, line
    command(path).make_context(path, words[n:])


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_of_a_page_are_accepted_by_their_parsers(page: Path) -> None:
    for line in commands_of(page):
        parse(line)


def test_pages_have_commands() -> None:
    assert sum(len(commands_of(page)) for page in PAGES) > 60


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_toml_of_a_page_is_valid(page: Path) -> None:
    for language, block in blocks_of(page):
        if language == "toml":
            tomllib.loads(block)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_python_of_a_page_compiles(page: Path) -> None:
    for language, block in blocks_of(page):
        if language == "python":
            ast.parse("\n".join(line for line in block.splitlines() if not line.startswith("%")))


def test_pages_are_short() -> None:
    words = {name_of(page): len(page.read_text(encoding="utf-8").split()) for page in PAGES}
    assert {page: n for page, n in words.items() if n > MAX_WORDS} == {}
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MAX_README_LINES


def test_folders_of_the_documentation_have_few_entries() -> None:
    folders = [
        DOCS,
        *(path for path in DOCS.rglob("*") if path.is_dir() and path.name not in ("pictures", "__pycache__")),
    ]
    entries = {name_of(folder): [p for p in folder.iterdir() if p.name != "__pycache__"] for folder in folders}
    assert {folder: len(found) for folder, found in entries.items() if len(found) > MAX_ENTRIES} == {}


def test_every_picture_is_shown() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [path.name for path in sorted((DOCS / "pictures").iterdir()) if path.name not in text] == []


@pytest.mark.parametrize("module", JSON)
def test_keys_of_json_are_documented(module: str) -> None:
    page = (DOCS / "reference" / "json" / "commands.md").read_text(encoding="utf-8")
    tree = ast.parse((ROOT / "monitor" / "cli" / module).read_text(encoding="utf-8"))
    functions = {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    dicts = [node for name in JSON[module] for node in ast.walk(functions[name]) if isinstance(node, ast.Dict)]
    keys = {str(key.value) for node in dicts for key in node.keys if isinstance(key, ast.Constant)}
    assert keys
    assert sorted(key for key in keys if f"`{key}`" not in page) == []


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_links_into_the_documentation_exist(name: str) -> None:
    """The site itself is built with broken links as errors."""
    named = re.findall(r"\]\((docs/[^)#]+)", (ROOT / name).read_text(encoding="utf-8"))
    assert [path for path in named if not (ROOT / path).is_file()] == []
