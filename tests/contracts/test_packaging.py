"""Installed packages are our own: generic names such as `daq` can be shadowed by others."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import daq
import monitor
import oma
import updater

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("package", [daq, oma, updater, monitor], ids=lambda p: str(p.__name__))
def test_package_is_imported_from_this_checkout(package: object) -> None:
    assert Path(str(package.__file__)).parent.parent == ROOT  # type: ignore[attr-defined]


@pytest.mark.parametrize("package", [daq, oma, updater], ids=lambda p: str(p.__name__))
def test_package_exports_are_unique_and_exist(package: object) -> None:
    names = package.__all__  # type: ignore[attr-defined]
    assert sorted(names) == sorted(set(names))
    assert all(hasattr(package, name) for name in names)


def test_all_four_packages_are_in_the_wheel() -> None:
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert content["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["daq", "oma", "updater", "monitor"]


def test_command_line_imports_no_large_packages() -> None:
    """`--help` answers at once: no numpy, no rerun, no analysis is loaded for it."""
    script = (
        "import monitor.cli.main, sys; print(sorted({'numpy', 'rerun', 'oma', 'updater', 'daq'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_lock_files_contain_no_urls_or_paths() -> None:
    lock, tools = ((ROOT / name).read_text(encoding="utf-8") for name in ("requirements.lock", "requirements-dev.lock"))
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", word) for word in tools.split())
    for requirement in lock.replace("\\\n", "").splitlines():
        assert re.fullmatch(r"[\w.-]+==[\w.]+( +--hash=sha256:[0-9a-f]{64})+", requirement), requirement


def test_lock_files_contain_all_project_dependencies() -> None:
    """The file with hashes holds the requirements of the program, and no tool of development."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    runtime, tools = (
        {_name(line) for line in (ROOT / name).read_text(encoding="utf-8").splitlines() if "==" in line}
        for name in ("requirements.lock", "requirements-dev.lock")
    )
    asked = project["project"]["dependencies"] + project["project"]["optional-dependencies"]["fleet"]
    assert {_name(line) for line in asked} <= runtime
    groups = project["dependency-groups"]
    assert {_name(line) for line in (*groups["dev"], *groups["docs"])} <= runtime | tools
    assert not runtime & (tools | {"pytest", "mypy", "ruff", "hypothesis"})


def _name(requirement: str) -> str:
    return re.split(r"[\[=<>!~ ]", requirement)[0].lower().replace("_", "-")
