"""A site whose devices are those of a virtual rig."""

from pathlib import Path

import pytest

from monitor.errors import StartError
from monitor.service.acquisition.devices import site_clock
from tests.support.monitor.played_windows import site_settings


def test_site_of_a_rig_that_is_over_is_refused(tmp_path: Path) -> None:
    settings = site_settings(f'[clock]\nspeed = 10.0\nshared = "{tmp_path / "time"}"\n')
    with pytest.raises(StartError, match=r"^clock\.shared: .*time: No such file or directory; is the rig over\?$"):
        site_clock(settings)
