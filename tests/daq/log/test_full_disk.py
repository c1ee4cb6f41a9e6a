"""A disk that is really full, in a separate process: written data remain, and recording continues later."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from daq import Block, Event, inspect_log, read_log
from daq.log import as_logs
from tests.support.daq.blocks import contents, make_block

pytestmark = pytest.mark.live

ROOT = Path(__file__).parents[3]
MOUNTED = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-c")
RECORDER = """
import json, shutil, sys, time
from pathlib import Path
from tests.support.daq.blocks import START, make_block
from daq.log import DiskGuard, ResilientWriter, RotatingWriter, WriterThread, Retention, Rotation
folder, out, ballast = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[1]) / "ballast"
reported = []
recorder = RotatingWriter(folder, {"site.toml": "x"}, START, Rotation(size=100_000 if sys.argv[3] == "many" else 1e9))
guard = DiskGuard(folder, Retention())
keeper = ResilientWriter(recorder, guard, lambda event: reported.append([event.topic, event.payload]))
with WriterThread(keeper, lambda item: None, chunk_seconds=0.02) as log:
    for k in range(400):
        log.put(make_block("a", 250 * k))
        time.sleep(0.001)
        if sys.argv[3] == "one" and k == 100:
            time.sleep(0.2)
            with ballast.open("wb", buffering=0) as file:
                try:
                    while file.write(bytes(1000)) == 1000:
                        pass
                except OSError:
                    pass
        if sys.argv[3] == "one" and k == 300:
            time.sleep(0.2)
            ballast.unlink()
ballast.unlink(missing_ok=True)
shutil.copytree(folder, out)
print(json.dumps({"reported": reported, "dropped": log.dropped, "problem": keeper.problem}))
"""


def can_mount(folder: Path) -> bool:
    try:
        return subprocess.run([*MOUNTED, f"mount -t tmpfs none '{folder}'"], capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


needs_mount = pytest.mark.skipif(
    not sys.platform.startswith("linux") or not can_mount(ROOT), reason="no user may mount a small disk here"
)


def record(tmp_path: Path, megabytes: float, how: str) -> tuple[dict[str, object], Path]:
    """Record 400 blocks, 1.5 MB, on a disk of a size; return the messages, and the copied logs."""
    disk, out, script = tmp_path / "disk", tmp_path / "out", tmp_path / "record.py"
    disk.mkdir()
    script.write_text(RECORDER)
    size = round(megabytes * 1e6)
    command = f"mount -t tmpfs -o size={size} none '{disk}' && '{sys.executable}' '{script}' '{disk}' '{out}' {how}"
    done = subprocess.run(
        [*MOUNTED, command],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), out


@needs_mount
def test_recording_continues_without_loss_after_disk_space_returns(tmp_path: Path) -> None:
    reported, out = record(tmp_path, 3.0, "one")
    assert (reported["dropped"], reported["problem"]) == (0, None)
    (log,) = as_logs([out])
    items = list(read_log(log))
    blocks = [item for item in items if isinstance(item, Block)]
    assert contents(blocks) == contents(make_block("a", 250 * k) for k in range(400))
    topics = [item.topic for item in items if isinstance(item, Event)]
    assert topics[0] == "/event/recording_failed"
    assert topics[-1] == "/event/recording_recovered"
    assert [topic for topic, _ in reported["reported"]] == topics  # type: ignore[attr-defined]
    assert all(inspect_log(path).whole for path in out.glob("*.mcap"))


@needs_mount
def test_oldest_files_are_deleted_and_remaining_files_are_complete(tmp_path: Path) -> None:
    reported, out = record(tmp_path, 0.8, "many")
    assert (reported["dropped"], reported["problem"]) == (0, None)
    (log,) = as_logs([out])
    items = list(read_log(log))
    indices = [item.first_index // 250 for item in items if isinstance(item, Block)]
    assert indices == list(range(indices[0], 400))  # the newest, without a gap
    assert 50 < len(indices) < 250  # 0.8 of 1.5 MB at the most
    deleted = [payload["file"] for topic, payload in reported["reported"] if topic == "/event/log_deleted"]  # type: ignore[attr-defined]
    assert deleted
    assert deleted == sorted(deleted)
    for path in out.glob("*.mcap"):
        assert inspect_log(path).lost_bytes == 0
