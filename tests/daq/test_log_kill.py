"""A killed writer loses half a second at most, and what is left is a log."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from daq import Block, read_attachments, read_log

WRITER = """
import sys, time
from pathlib import Path
import numpy as np
from daq import Block, LogThread, LogWriter

writer = LogWriter(Path(sys.argv[1]), {"site.toml": "x = 1"})
with LogThread(writer, lambda item: None) as log:
    for k in range(10_000):
        counts = np.random.default_rng(k).integers(-(2**31), 2**31, (10, 3)).astype(np.int32)
        log.put(Block(device="a", rate=1000.0, first_index=10 * k, counts=counts, scale=1.0, pair_index=10 * k + 9,
                      pair_time=time.time_ns(), temperature=20.0))
        sys.stdout.write(f"{k}\\n")
        sys.stdout.flush()
        time.sleep(0.01)
"""


@pytest.mark.parametrize("seconds", [1.0, 1.3])
def test_killed_writer_loses_half_a_second(tmp_path: Path, seconds: float) -> None:
    path = tmp_path / "log.mcap"
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(seconds)
        killed = time.time_ns()
        process.kill()
    blocks = [item for item in read_log(path) if isinstance(item, Block)]
    # A chunk every 0.4 s; the rest is the flush itself (fdatasync of this disk).
    assert (killed - blocks[-1].pair_time) * 1e-9 < 0.5 + 0.3
    assert [b.first_index for b in blocks] == [10 * k for k in range(len(blocks))]
    for k, block in enumerate(blocks):
        expected = np.random.default_rng(k).integers(-(2**31), 2**31, (10, 3)).astype(np.int32)
        np.testing.assert_array_equal(block.counts, expected)
    assert read_attachments(path) == {"site.toml": "x = 1"}
