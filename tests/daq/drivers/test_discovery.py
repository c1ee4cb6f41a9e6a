"""Connected devices: ports by their lasting names, and the devices that respond at them."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from daq import DriverError, SystemClock, make_driver, search_port, serial_ports
from daq.drivers import PortAnswer, can_adapters
from daq.emulator import EmulatedNode
from tests.support.daq.can_buses import pty, serving
from tests.support.daq.emulated_ports import Ramp


def test_ports_are_listed_by_persistent_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usb, plain = tmp_path / "ttyUSB0", tmp_path / "ttyS0"
    usb.touch()
    plain.touch()
    link = tmp_path / "by-id" / "usb-FTDI_A352-if00"
    link.parent.mkdir()
    link.symlink_to(usb)
    reported = [
        SimpleNamespace(device=str(usb), vid=0x0403, description="FT232R"),
        SimpleNamespace(device=str(plain), vid=None, description="n/a"),
    ]
    monkeypatch.setattr("daq.drivers.discovery.list_ports.comports", lambda: reported)
    found = serial_ports(link.parent)
    assert [(p.device, p.by_id, p.path) for p in found] == [
        (str(plain), None, str(plain)),
        (str(usb), str(link), str(link)),
    ]
    assert [(p.description, p.is_usb) for p in found] == [("", False), ("FT232R", True)]
    assert [p.path for p in serial_ports(tmp_path / "none")] == [str(plain), str(usb)]


def test_can_adapters_are_those_detected_by_python_can(monkeypatch: pytest.MonkeyPatch) -> None:
    reported = [{"interface": "pcan", "channel": "PCAN_USBBUS1", "supports_fd": True}]
    monkeypatch.setattr("can.detect_available_configs", lambda interfaces: reported if "pcan" in interfaces else [])
    assert can_adapters() == [("pcan", "PCAN_USBBUS1")]


def test_missing_or_invalid_port_is_named_in_the_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    reasons = {"none": "No such file or directory", "file": "Inappropriate ioctl for device"}
    for path, reason in ((tmp_path / name, reason) for name, reason in reasons.items()):
        with pytest.raises(DriverError, match=f"^{path}: cannot be opened: {reason}$"):
            search_port(str(path))


def test_invalid_network_address_is_named_in_the_error() -> None:
    for address in ("tcp://host", "tcp://127.0.0.1:1"):
        with pytest.raises(DriverError, match=f"^{address}: cannot be opened: "):
            search_port(address)


@pytest.mark.live
def test_search_does_not_disturb_port_in_use() -> None:
    device = EmulatedNode(Ramp(), SystemClock(), serial_number="N")
    with serving(device.serve):
        driver = make_driver("modalwatch-node", device.port, 1000.0)
        driver.open()
        with pytest.raises(DriverError, match=f"^{device.port}: cannot be opened: the port is in use by"):
            search_port(device.port)
        assert len(driver.read().counts)
        driver.close()
        answer = search_port(device.port)
    device.close()
    assert isinstance(answer, PortAnswer)
    assert answer.who == "emulated N"


@pytest.mark.live
def test_echoing_modem_is_not_detected_as_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """It echoes every line, and responds to it."""
    monkeypatch.setattr("daq.drivers.serial.witmotion.BAUDS", (115_200,))
    monkeypatch.setattr("daq.drivers.serial.node._HELLO_SECONDS", 0.3)
    monkeypatch.setattr("daq.drivers.serial.text_search._FIRST_SECONDS", 0.2)
    with pty() as (line, path):
        os.set_blocking(line, False)

        def serve() -> None:
            try:
                heard = os.read(line, 256)
            except OSError:
                return
            os.write(line, heard + (b"\r\nERROR\r\n" if b"\r" in heard else b""))

        with serving(serve):
            assert search_port(path) is None
