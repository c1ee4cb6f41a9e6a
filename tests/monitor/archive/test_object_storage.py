"""Archives in object storage: a real S3 server on loopback."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import fsspec
import numpy as np
import pandas as pd
import pytest
import s3fs
from distributed import LocalCluster

from daq import read_attachments
from monitor.archive import find_logs
from monitor.archive.catalog import stored_logs
from tests.support.monitor.cli import Commands, assert_refused
from updater import t_structure_toml

pytestmark = pytest.mark.timeout(300)

RECORDED = Path(__file__).parents[3] / "replay_data" / "t_frame_added_mass.mcap"
FIRST_WINDOWS = 1_000_000  # bytes of the recorded log, with three windows


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[s3fs.S3FileSystem]:
    """Start moto's S3 server with a bucket "tower"; the environment names it, as for any program of AWS."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    log = tmp_path_factory.mktemp("s3") / "server.txt"
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    environment = {
        "AWS_ENDPOINT_URL": url,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    with pytest.MonkeyPatch.context() as patch, log.open("w") as out:
        for name, value in environment.items():
            patch.setenv(name, value)
        with subprocess.Popen(command, stdout=out, stderr=out, env=dict(os.environ)) as process:
            try:
                until_open(port, process)
                storage = s3fs.S3FileSystem()
                storage.mkdir("tower")
                yield storage
            finally:
                process.kill()
                fsspec.spec.AbstractFileSystem.clear_instance_cache()


def until_open(port: int, process: subprocess.Popen[bytes], seconds: float = 120.0) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        assert process.poll() is None, "the server has ended"
        with socket.socket() as client:
            if client.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the server does not respond")


def fill(storage: s3fs.S3FileSystem, folder: str, n: int) -> None:
    """Put n logs of three windows, each different, and an object that is no log."""
    whole = RECORDED.read_bytes()
    for k in range(n):
        storage.pipe_file(f"tower/{folder}/year{k % 4}/log{k:03d}.mcap", whole[: FIRST_WINDOWS + k])
    storage.pipe_file(f"tower/{folder}/poisoned.mcap", b"not a log")


@pytest.mark.parametrize(
    "n",
    [
        pytest.param(2, marks=pytest.mark.timeout(300)),
        pytest.param(200, marks=[pytest.mark.thorough, pytest.mark.timeout(1200)]),
    ],
)
def test_bucket_is_analysed_as_local_files_and_only_once(
    n: int, server: s3fs.S3FileSystem, modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An object that is no log is reported and stops nothing; the tables are those of the same files on disk.

    Of two logs the workers are threads: the processes are those of `test_reanalysis.py`.
    """
    if n < 10:
        monkeypatch.setattr("distributed.LocalCluster", partial(LocalCluster, processes=False))
    fill(server, f"of{n}", n)
    server.get(f"tower/of{n}", str(tmp_path / "local"), recursive=True)
    (tmp_path / "local" / "poisoned.mcap").unlink()
    assert modalwatch("reanalyse", tmp_path / "local", "-o", tmp_path / "a", "--workers", 2).code == 0
    found = modalwatch("reanalyse", f"s3://tower/of{n}", "-o", tmp_path / "b", "--workers", 2)
    assert found.code == 1, found.err  # one object is not a log
    assert f"s3://tower/of{n}/poisoned.mcap: is not an MCAP log" in found.out
    modes = [pd.read_parquet(tmp_path / out / "modes").sort_values(["start", "log", "mode"]) for out in "ab"]
    one, other = (frame.drop(columns=["log", "site"]).reset_index(drop=True) for frame in modes)
    assert len(one) >= 15 * n
    pd.testing.assert_frame_equal(one, other)
    again = modalwatch("reanalyse", f"s3://tower/of{n}", "-o", tmp_path / "b", "--dry-run")
    assert again.out.count("identified by an earlier run") == n


def test_plan_requests_only_the_ends_of_a_log(
    server: s3fs.S3FileSystem, modalwatch: Commands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    structure = tmp_path / "structure.toml"
    structure.write_text(t_structure_toml())
    channels = ["col_037_x", "col_074_x", "col_111_x"]
    data = np.random.default_rng(1).standard_normal((1_000_000, 3))
    np.savez(tmp_path / "noise.npz", data=data, rate=1000.0, channels=channels)
    log = tmp_path / "noise.mcap"
    options = ["--structure", structure, "--new-site", tmp_path / "site.toml"]
    done = modalwatch("import", tmp_path / "noise.npz", "-o", log, *options)
    assert done.code == 0, done.err
    server.put_file(str(log), "tower/noise/noise.mcap")
    requested: list[int] = []
    fetch = s3fs.S3FileSystem._cat_file

    async def counted(self: s3fs.S3FileSystem, path: str, start: int, end: int) -> bytes:
        requested.append(end - start)
        return bytes(await fetch(self, path, start=start, end=end))

    monkeypatch.setattr(s3fs.S3FileSystem, "_cat_file", counted)
    s3fs.S3FileSystem.clear_instance_cache()
    planned = modalwatch("reanalyse", "s3://tower/noise", "-o", tmp_path / "out", "--dry-run")
    assert "s3://tower/noise/noise.mcap: to be identified" in planned.out
    assert 0 < sum(requested) < 0.3 * log.stat().st_size, (requested, log.stat().st_size)


def test_changed_object_has_another_key(server: s3fs.S3FileSystem) -> None:
    content = RECORDED.read_bytes()[:FIRST_WINDOWS]
    server.pipe_file("tower/changed/a.mcap", content)
    [before] = find_logs(["s3://tower/changed"])
    server.pipe_file("tower/changed/a.mcap", content + b"\0")
    server.invalidate_cache()
    [after] = find_logs(["s3://tower/changed"])
    assert before.name == after.name == "s3://tower/changed/a.mcap"
    assert (before.key != after.key, after.size - before.size) == (True, 1)


def test_storage_error_while_reading_is_reported_with_the_url(server: s3fs.S3FileSystem) -> None:
    server.pipe_file("tower/gone/a.mcap", RECORDED.read_bytes()[:FIRST_WINDOWS])
    [stored] = stored_logs("s3://tower/gone")
    server.rm("tower/gone/a.mcap")
    server.invalidate_cache()
    with pytest.raises(Exception, match=r"s3://tower/gone/a\.mcap: cannot be read: FileNotFoundError"):
        read_attachments(stored.as_path())


def test_bucket_that_does_not_exist_is_one_clear_error(server: s3fs.S3FileSystem, modalwatch: Commands) -> None:
    done = modalwatch("reanalyse", "s3://nowhere", "-o", "out", "--dry-run")
    assert (done.code, len(done.err.splitlines())) == (2, 1), done.err
    assert "s3://nowhere" in done.err


def test_url_without_fsspec_is_one_clear_error(modalwatch: Commands, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    done = modalwatch("reanalyse", "s3://tower", "-o", "out", "--dry-run")
    assert_refused(done, "ARCHIVE: s3://tower: fsspec is not installed: pip install 'modalwatch[fleet]'")
