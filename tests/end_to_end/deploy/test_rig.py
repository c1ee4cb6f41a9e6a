"""The shipped start of the virtual rig brings up a monitor with streaming devices."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from tests.support.processes import free_port

ROOT = Path(__file__).parents[3]
TOKEN = "0123456789abcdef"
N_DEVICES = 6


def programs(folder: Path) -> Path:
    """Write the two programs that start.sh uses in the image, as they are here."""
    for name, words in (("modalwatch", '-c "from monitor.cli.main import main; main()" "$@"'), ("python", '"$@"')):
        (folder / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words}\n')
        (folder / name).chmod(0o755)
    return folder


def streaming(text: str) -> list[str]:
    """Return the devices in metrics that have sent more than a second of scans."""
    found = re.findall(r'^modalwatch_scans\{device="(\w+)"\} (\S+)$', text, re.MULTILINE)
    return [device for device, scans in found if float(scans) > 500]


@pytest.mark.thorough
@pytest.mark.live
def test_rig_script_starts_a_monitor_whose_devices_stream(tmp_path: Path) -> None:
    """Settings come from the environment, as in compose.yaml; without the token nothing is answered."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "site").mkdir()
    (tmp_path / "token").write_text(TOKEN)
    port = free_port()
    environment = os.environ | {
        "PATH": f"{programs(tmp_path / 'bin')}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "MODALWATCH_WEB__BIND": "0.0.0.0",
        "MODALWATCH_WEB__PORT": str(port),
        "MODALWATCH_WEB__TOKEN_FILE": str(tmp_path / "token"),
        "MODALWATCH_RECORDER__MIN_FREE_GB": "0",
    }
    command = ["sh", str(ROOT / "deploy" / "rig" / "start.sh")]
    with (
        (tmp_path / "output").open("wb") as output,
        subprocess.Popen(
            command,
            cwd=tmp_path / "site",
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        ) as process,
    ):
        try:
            end, text = time.monotonic() + 60.0, ""
            while len(streaming(text)) < N_DEVICES:
                assert process.poll() is None, (tmp_path / "output").read_text()
                assert time.monotonic() < end, text
                time.sleep(0.2)
                try:
                    answer = httpx.get(
                        f"http://127.0.0.1:{port}/metrics", headers={"Authorization": f"Bearer {TOKEN}"}, timeout=10.0
                    )
                except httpx.TransportError:
                    continue
                assert answer.status_code == 200
                text = answer.text
            assert httpx.get(f"http://127.0.0.1:{port}/metrics").status_code == 401
            assert 'modalwatch_device_lost{device="beam_right"} 0.0' in text
        finally:
            os.killpg(process.pid, signal.SIGKILL)
