"""A replay that cannot continue ends with the reason."""

from pathlib import Path

import pytest

from daq import LogError, McapWriter
from monitor.errors import SettingsError
from monitor.service.replay import replay
from tests.support.daq.blocks import make_block
from updater import t_structure_toml

SITE = """structure = "t_structure.toml"
[[device]]
name = "beam_left"
driver = "epson-uart"
port = "/dev/none"
channels = {y = "beam_left_y", z = "beam_left_z"}
"""


def log(path: Path, *devices: str, site: str = SITE) -> Path:
    """Write a log of two chunks, a block a device in each."""
    writer = McapWriter(path, {"site.toml": site, "structure.toml": t_structure_toml()})
    for first in (0, 250):
        for device in devices:
            writer.write(make_block(device, first))
        writer.flush()
    writer.close()
    return path


def test_a_device_that_the_settings_do_not_know(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left", "stranger")
    with pytest.raises(LogError, match=r"log\.mcap: holds device 'stranger'; the settings have beam_left"):
        replay(path, None, lambda _: None)


def test_a_log_that_is_damaged_amid(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left")
    content = bytearray(path.read_bytes())
    content[len(content) * 2 // 3] ^= 1  # in the second chunk
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"log\.mcap: is damaged before byte \d+"):
        replay(path, None, lambda _: None)


def test_settings_attached_that_cannot_be_used(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left", site=SITE.replace("driver", "diver"))
    with pytest.raises(SettingsError, match=r"log\.mcap: site\.toml: device\.0\.diver: no such setting"):
        replay(path, None, lambda _: None)
