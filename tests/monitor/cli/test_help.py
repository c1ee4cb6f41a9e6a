"""Every command describes its purpose, without delay."""

import subprocess
import sys

import pytest

from monitor.cli.main import app
from monitor.cli.tables.data import data_app
from monitor.cli.tables.log import log_app
from monitor.cli.tables.site import site_app
from tests.support.monitor.cli import Commands

COMMANDS: list[tuple[str, ...]] = [
    (c.name or str(c.callback and c.callback.__name__),)
    for table in (app, site_app, data_app)
    for c in table.registered_commands
]
COMMANDS += [("log", str(c.name)) for c in log_app.registered_commands]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_describes_each_command(modalwatch: Commands, command: tuple[str, ...]) -> None:
    done = modalwatch(*command, "--help")
    assert (done.code, done.err) == (0, "")
    assert f"Usage: modalwatch {' '.join(command)} " in done.out
    assert len(done.out.splitlines()[2].strip()) >= len("Summarize a log.")  # a sentence
    everything = modalwatch("--help").out
    assert f"  {command[0]} " in everything


def test_help_imports_no_slow_packages() -> None:
    heavy = {"numpy", "scipy", "pydantic", "rerun", "rich", "matplotlib"}
    code = f"import sys, monitor.cli.main; sys.exit(str({heavy} & {{*sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr.strip() == "set()"
