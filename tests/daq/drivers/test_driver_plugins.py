"""Drivers of others: an installed distribution has one, and its possible errors."""

from pathlib import Path

import pytest

from daq import CanAddress, DeviceIdentity, driver_names, make_driver

MODULE = '''
"""A driver of somebody's own."""

from daq import DeviceIdentity

class Mine:
    scale, modulus = 1e-3, 256

    def __init__(self, place, rate):
        self.place, self.rate = place, rate

    def open(self):
        return DeviceIdentity(product="mine")

    def read(self):
        return []

    def close(self):
        return None
'''


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install a distribution: a module and its metadata in a folder that Python looks into."""
    (tmp_path / "a_driver_of_mine.py").write_text(MODULE, encoding="utf-8")
    folder = tmp_path / "mine-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n", encoding="utf-8")
    lines = (
        "mine = a_driver_of_mine:Mine",
        "epson-uart = a_driver_of_mine:Mine",
        "gone = a_driver_that_is_gone:Mine",
        "misspelt = a_driver_of_mine:Min",
        "number = math:pi",
    )
    (folder / "entry_points.txt").write_text("[modalwatch.drivers]\n" + "\n".join(lines) + "\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("installed")
def test_plugin_driver_is_created_by_name() -> None:
    assert {"epson-uart", "mine"} <= set(driver_names())
    for place in ("COM3", CanAddress(interface="virtual", channel="a", node=1)):
        driver = make_driver("mine", place, 42.0)
        assert (type(driver).__module__, driver.open()) == ("a_driver_of_mine", DeviceIdentity(product="mine"))
        assert (driver.place, driver.rate) == (place, 42.0)  # type: ignore[attr-defined]


@pytest.mark.usefixtures("installed")
def test_plugin_does_not_replace_builtin_driver() -> None:
    assert type(make_driver("epson-uart", "COM3", 500.0)).__module__ == "daq.drivers.serial.epson_uart"
    assert driver_names().count("epson-uart") == 1


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("gone", "driver gone: a_driver_that_is_gone:Mine cannot be loaded: No module named"),
        ("misspelt", "driver misspelt: a_driver_of_mine:Min cannot be loaded: .* has no attribute 'Min'"),
        ("number", "driver number: math:pi is no driver: it has no open, read, close"),
        ("nobody", "driver: expected one of .*mine, misspelt.*, found 'nobody'"),
    ],
)
def test_unusable_plugin_driver_is_named_in_the_error(name: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        make_driver(name, "COM3", 42.0)


def test_plugin_driver_is_absent_without_its_distribution() -> None:
    assert "mine" not in driver_names()
