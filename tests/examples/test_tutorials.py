"""The pages of "Get started": their commands, run in their order, lead to the right answers."""

import json
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path

import pytest

from tests.support.monitor.cli import Commands, Done
from tests.support.snippets import named_files, shell_lines

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "get_started"
MASS, X = 0.4, 0.80  # of the block that examples/portal_tables.py clamps on [kg], [m]

WINDOWS = 13  # of 15 s in the recorded log of the rehearsal

pytestmark = pytest.mark.thorough


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Return a folder that has what the pages use of the repository."""
    for name in ("examples", "replay_data", "updater"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def watch(arguments: list[str]) -> None:
    """Monitor until all windows of the recorded log are analysed; then stop the process as Ctrl-C does."""
    command = [sys.executable, "-c", "from monitor.cli.main import main; main()", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        lines = list(takewhile(lambda line: f"window  {WINDOWS} " not in line, process.stdout))
        print(*lines, sep="")
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 0


@pytest.fixture
def follow(repository: Path, modalwatch: Commands, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], dict[str, Done]]:
    """Return a function that runs the commands of a page; its files are saved before the first command needs them."""

    def run(page: str) -> dict[str, Done]:
        done = {}
        monkeypatch.chdir(repository)
        for line in shell_lines(PAGES / page):
            command, *arguments = shlex.split(line)
            if command == "cd":
                monkeypatch.chdir(Path.cwd() / arguments[0])
                for name, text in named_files(PAGES / page).items():
                    Path(name).write_text(text, encoding="utf-8")
            elif arguments[:1] == ["run"]:
                watch(arguments)
            elif command == "modalwatch":
                done[line] = modalwatch(*arguments)
            elif command == "python":
                monkeypatch.setattr(sys, "argv", arguments)
                runpy.run_path(arguments[0])
            else:
                subprocess.run([shutil.which(command) or command, *arguments], check=True)
        return done

    return run


@pytest.mark.usefixtures("undrawn")
def test_tables_lead_to_the_clamped_mass(follow: Callable[[str], dict[str, Done]]) -> None:
    done = follow("data.md")
    assert not [one for one in done.values() if one.code]
    (cause,) = json.loads(Path("found/diagnosis.json").read_text(encoding="utf-8"))["causes"]
    mass, where = cause["parameters"]["mass"], cause["where"]
    assert cause["cause"] == "added_mass"
    assert abs(mass["value"] - MASS) < 3 * mass["std"]
    assert where["member"] == "beam"
    assert abs(where["position"][0] - X) < 3 * where["position_std"]


@pytest.mark.live
@pytest.mark.xdist_group("busy")
def test_rehearsal_ends_with_a_proven_site(follow: Callable[[str], dict[str, Done]]) -> None:
    done = follow("rig.md")
    assert [one.code for one in done.values()] == [0] * 4
    assert "proven" in done["modalwatch prove site.toml --mass 0.1971 --position 0.1568,1.48"].out
    assert "added on the crossbeam" in Path("report.html").read_text(encoding="utf-8")
