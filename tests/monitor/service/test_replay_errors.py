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


def test_unknown_device_in_the_log_is_refused(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left", "stranger")
    with pytest.raises(LogError, match=r"log\.mcap: holds device 'stranger'; the settings have beam_left"):
        replay(path, None, lambda _: None)


def test_log_damaged_in_the_middle_is_refused(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left")
    content = bytearray(path.read_bytes())
    content[len(content) * 2 // 3] ^= 1  # in the second chunk
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"log\.mcap: is damaged before byte \d+"):
        replay(path, None, lambda _: None)


def test_unusable_attached_settings_are_refused(tmp_path: Path) -> None:
    path = log(tmp_path / "log.mcap", "beam_left", site=SITE.replace("driver", "diver"))
    with pytest.raises(SettingsError, match=r"log\.mcap: site\.toml: device\.0\.diver: no such setting"):
        replay(path, None, lambda _: None)
