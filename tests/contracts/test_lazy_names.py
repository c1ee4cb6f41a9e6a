"""Names of packages that are imported at their first use: each exists, and a log is read without drivers."""

import subprocess
import sys
from importlib import import_module

import pytest

LAZY = (
    "daq",
    "daq.drivers",
    "daq.emulator",
    "daq.files",
    "oma",
    "oma.preparation",
    "updater",
    "updater.diagnosis",
    "updater.fe",
    "updater.localization",
    "updater.modal_data",
    "updater.planning",
    "updater.validation",
    "monitor.detection",
    "monitor.watch.memory",
)
ANALYSIS = {"scipy", "oma.identification", "updater.fe", "updater.causes", "monitor.watch.pipeline"}


@pytest.mark.parametrize("name", LAZY)
def test_every_listed_name_exists(name: str) -> None:
    package = import_module(name)
    assert set(package.__all__) == set(dir(package))
    assert all(getattr(package, each) is not None for each in package.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = package.nothing


def test_identify_loads_no_driver_settings_or_statistics() -> None:
    code = "import monitor.cli.data.identify.identification, monitor.cli.data.identify.identification_output"
    assert not loaded(code) & {"can", "pydantic", "scipy.signal", "scipy.stats", "updater.fe"}


@pytest.mark.parametrize(
    "module",
    ["monitor.cli.site.monitoring", "monitor.service.servers.web.process", "monitor.service.servers.fleet"],
)
def test_acquisition_and_pages_load_no_analysis(module: str) -> None:
    """The analysis has a process of its own; loaded in the others too, it would double the time of their start."""
    assert not loaded(f"import {module}") & ANALYSIS


def test_analysis_and_rig_load_no_statistics_or_filters_at_their_start() -> None:
    modules = loaded("import monitor.watch.pipeline, monitor.rig.process")
    assert not modules & {"asammdf", "cantools", "scipy.io", "scipy.signal", "scipy.stats"}


def loaded(code: str) -> set[str]:
    """Run a line in a process of its own; return the modules that are loaded then."""
    code += "; import sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return set(done.stdout.split())
