"""Loss of a log by kill -9: 0.3 s at most, with blocks of 0.2 s half a second."""

import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest

from daq import Block, read_attachments, read_log
from tests.support.daq.blocks import make_block

pytestmark = pytest.mark.live

MAX_SECONDS = 0.3  # of what was put, six chunks
WRITER = """
import sys, time
from pathlib import Path
from tests.support.daq.blocks import make_block
from daq import McapWriter
from daq.log import WriterThread
with WriterThread(McapWriter(Path(sys.argv[1]), {"site.toml": "x"}), lambda item: None) as log:
    for k in range(10**6):
        log.put(make_block("a", 250 * k))
        print(k, flush=True)
        time.sleep(0.005)
"""
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("seconds", [0.3, 0.95, 1.7])
def test_killed_process_loses_only_the_last_fraction_of_a_second(tmp_path: Path, seconds: float) -> None:
    path = tmp_path / "log.mcap"
    put: list[float] = []  # when each block was known to be put
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        stdout=subprocess.PIPE,
        env={"PYTHONPATH": str(ROOT)},
    ) as process:
        assert process.stdout is not None
        while not put or put[-1] - put[0] < seconds:
            assert process.stdout.readline()
            put.append(time.monotonic())
        process.kill()
        killed = time.monotonic()
    blocks = [item for item in read_log(path) if isinstance(item, Block)]
    held_up = max(later - earlier for earlier, later in pairwise(put))  # by other programs, in which no thread ran
    safe = sum(when < killed - MAX_SECONDS - held_up for when in put)
    assert safe > 0 or seconds < 0.9
    assert len(blocks) >= safe
    for k, block in enumerate(blocks):
        assert block.first_index == 250 * k
        assert (block.counts == make_block("a", 250 * k).counts).all()
    assert read_attachments(path) == {"site.toml": "x"}
