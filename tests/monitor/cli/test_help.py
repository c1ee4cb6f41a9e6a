"""Every command describes its purpose and shows an example, without delay; the shell completes its name."""

import inspect
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from daq.files import TIME_UNITS as UNITS_OF_TIMES
from monitor.cli.commands import COMMANDS, command, command_function
from monitor.cli.options import ANIMATIONS, METHODS, TIME_UNITS
from monitor.views.animation import SUFFIXES
from oma import METHODS as METHODS_OF_OMA
from tests.support.monitor.cli import Commands
from updater.causes import CATALOGUE
from updater.quantities import cause_name, plain

CLI = Path(inspect.getfile(command)).parent
HEAVY = {"numpy", "scipy", "pydantic", "rerun", "rich", "matplotlib", "daq", "oma", "updater"}
RUN = "from monitor.cli.main import main; main()"


@pytest.mark.parametrize("path", COMMANDS)
def test_help_describes_each_command(modalwatch: Commands, path: str) -> None:
    done = modalwatch(*path.split(), "--help")
    assert (done.code, done.err) == (0, "")
    assert f"Usage: modalwatch {path} " in done.out
    assert len(done.out.splitlines()[2].strip()) >= len("Summarize a log.")  # a sentence
    example = done.out.partition("\nExample:\n")[2]
    assert example.startswith("  modalwatch ")
    assert max(map(len, example.splitlines())) <= 80


def test_help_and_page_of_diagnose_list_the_causes(modalwatch: Commands) -> None:
    text = " ".join(modalwatch("diagnose", "--help").out.split())
    listed = text.partition("Names of causes for --only and --without: ")[2].partition(".")[0]
    assert listed.split(", ") == list(CATALOGUE)
    page = Path("docs/howto/data/diagnose.md").read_text(encoding="utf-8")
    assert [name for name in CATALOGUE if f"`{name}`" not in page] == []
    assert [cause_name(words) for words in map(plain, CATALOGUE)] == list(CATALOGUE)


def test_words_of_a_cause_are_accepted_and_an_unknown_one_is_refused_before_files_are_read(
    modalwatch: Commands,
) -> None:
    files = ("no_structure.toml", "no_log.mcap")
    assert "no_structure.toml" in modalwatch("diagnose", *files, "--only", "dead sensor", "--without", "mesh error").err
    refused = modalwatch("diagnose", *files, "--only", "local stifness")
    assert "--only, --without: no cause is named 'local_stifness', did you mean 'local_stiffness'?" in refused.err


@pytest.mark.parametrize("command", [("diagnose",), ("response", "--predict-sensors", "--reference", "a.mcap")])
def test_structure_file_after_the_log_is_refused_with_the_right_order(
    command: tuple[str, ...], modalwatch: Commands
) -> None:
    name, *options = command
    refused = modalwatch(name, "now.mcap", "frame.toml", *options)
    assert refused.code == 2
    assert "STRUCTURE.toml: expected the structure file before the logs: frame.toml now.mcap" in refused.err


def test_help_lists_all_commands_aligned_under_their_sections(
    modalwatch: Commands, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = modalwatch("--help").out.split("Start:\n")[1].splitlines()
    listed = [line for line in lines if line.startswith("  ")]
    assert [line[2:18].rstrip() for line in listed] == list(COMMANDS)
    assert all(line[17:19].strip() == "" and line[19:].endswith(".") for line in listed)  # one line each
    headings = [line.removesuffix(":") for line in lines if line and not line.startswith("  ")]
    assert ["Start", *headings] == list(dict.fromkeys(section for section, _ in COMMANDS.values()))


@pytest.mark.parametrize("path", COMMANDS)
def test_example_is_accepted_by_the_parser_of_its_command(path: str) -> None:
    lines = (command(path).epilog or "").replace("\\\n", "").splitlines()
    assert 1 <= len(lines) <= 3
    for line in lines:
        words = shlex.split(line.partition(" > ")[0].removeprefix("sudo "))
        assert words[: 1 + path.count(" ") + 1] == ["modalwatch", *path.split()]
        command(path).make_context(path, words[2 + path.count(" ") :])  # raises for an unknown option or value


def test_files_of_commands_are_those_of_the_table() -> None:
    functions = {Path(inspect.getfile(command_function(path))) for path in COMMANDS}
    assert len(functions) == len(COMMANDS)
    with_signatures = {p for p in CLI.rglob("*.py") if p.read_text(encoding="utf-8").startswith('"""Command `')}
    assert {p for p in with_signatures if p.name != "__init__.py"} == functions


@pytest.mark.parametrize("arguments", [["--help"], ["identify", "--help"], ["log", "--help"]], ids=" ".join)
def test_help_imports_no_slow_packages(arguments: list[str]) -> None:
    code = f"import sys; sys.argv[1:] = {arguments}\nfrom monitor.cli.main import _run\n_run()\n"
    code += f"sys.exit(str({HEAVY} & {{*sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr.strip() == "set()"


def test_only_the_called_command_is_imported() -> None:
    code = "import sys; sys.argv[1:] = ['settings', '--help']\nfrom monitor.cli.main import _run\n_run()\n"
    code += "sys.exit(str({m for m in sys.modules if m.startswith('monitor.cli.') and m.count('.') > 2}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr.strip() == "{'monitor.cli.site.settings'}"


def test_listed_values_of_options_are_those_of_the_packages(modalwatch: Commands) -> None:
    assert tuple(METHODS_OF_OMA) == METHODS
    assert tuple(UNITS_OF_TIMES) == TIME_UNITS
    assert SUFFIXES == ANIMATIONS
    assert f"--method {'|'.join(METHODS)}" in modalwatch("identify", "--help").out
    assert f"--time-unit {'|'.join(TIME_UNITS)}" in modalwatch("import", "--help").out


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("modalwatch ide", "identify"),
        ("modalwatch log ex", "export\nexpand"),
        ("modalwatch identify --meth", "--method"),
        ("modalwatch identify --method fs", "fsdd"),
    ],
)
def test_shell_completes(words: str, completed: str) -> None:
    environment = os.environ | {
        "_MODALWATCH_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(words.count(" ")),
    }
    done = subprocess.run(
        [sys.executable, "-c", RUN], capture_output=True, text=True, timeout=60, check=False, env=environment
    )
    assert (done.returncode, done.stderr, done.stdout.strip()) == (0, "", completed)


def test_completion_script_is_written_for_a_named_shell() -> None:
    environment = os.environ | {"_MODALWATCH_COMPLETE": "source_bash"}
    done = subprocess.run(
        [sys.executable, "-c", RUN], capture_output=True, text=True, timeout=60, check=False, env=environment
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "complete -o default -F _modalwatch_completion modalwatch" in done.stdout


def test_unknown_command_is_answered_with_similar_ones(modalwatch: Commands) -> None:
    done = modalwatch("identfy")
    assert (done.code, done.out) == (2, "")
    assert done.err == "error: No such command 'identfy'. Did you mean 'modalwatch identify'?\nsee modalwatch --help\n"


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["export"], "No such command 'export'. Did you mean 'modalwatch log export'?\nsee modalwatch --help\n"),
        (["nw", "site"], "No such command 'nw'. Did you mean 'modalwatch new'?\nsee modalwatch --help\n"),
        (["log", "replay"], "No such command 'replay'. Did you mean 'modalwatch replay'?\nsee modalwatch log --help\n"),
        (["xyzzy"], "No such command 'xyzzy'.\nsee modalwatch --help\n"),
        (["log", "info"], "Missing argument 'LOG.mcap...|DIR'.\nsee modalwatch log info --help\n"),
        (
            ["identify", "--structur", "a"],
            "No such option: --structur (Possible options: --picture, --structure)\nsee modalwatch identify --help\n",
        ),
    ],
)
def test_error_of_the_command_line_is_followed_by_the_command_of_its_help(
    modalwatch: Commands, words: list[str], error: str
) -> None:
    done = modalwatch(*words)
    assert (done.code, done.out, done.err) == (2, "", f"error: {error}")


def test_group_without_a_command_prints_its_help(modalwatch: Commands) -> None:
    done = modalwatch("log")
    assert done.code == 2
    assert (done.out + done.err).startswith("Usage: modalwatch log ")


def test_each_option_has_one_kind_of_value_in_all_commands() -> None:
    """Files to write differ from command to command, and the channels of a site are an additional source of names."""
    kinds: dict[str, set[str | None]] = {}
    for path in COMMANDS:
        for parameter in command(path).params:
            for name in parameter.opts:
                kinds.setdefault(name, set()).add(parameter.metavar)
    several = {name for name, found in kinds.items() if len(found) > 1 and name.startswith("-")}
    assert several == {"--out", "-o", "--channels"}
