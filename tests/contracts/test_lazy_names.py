"""Names of packages that are imported at their first use: each exists, and a log is read without drivers."""

import subprocess
import sys
from importlib import import_module

import pytest

LAZY = ("daq", "daq.drivers", "daq.files", "updater", "updater.planning", "updater.validation", "monitor.detection")


@pytest.mark.parametrize("name", LAZY)
def test_every_listed_name_exists(name: str) -> None:
    package = import_module(name)
    assert set(package.__all__) == set(dir(package))
    assert all(getattr(package, each) is not None for each in package.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = package.nothing


def test_identify_loads_no_driver_settings_or_statistics() -> None:
    code = (
        "import sys; import monitor.cli.data.identify.identification, monitor.cli.data.identify.identification_output; "
        "print(*sorted({'can', 'pydantic', 'scipy.signal', 'scipy.stats', 'updater.fe'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == ""
