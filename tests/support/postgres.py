"""A PostgreSQL server of the tests' own, on a socket of its own, gone with the test."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_PLACES = ("/usr/lib/postgresql", "/usr/local/lib/postgresql")


def postgres_programs() -> Path | None:
    """Return the folder with initdb and pg_ctl, None if there is no server installed."""
    found = shutil.which("initdb")
    candidates = [Path(found).parent] if found else []
    candidates += [path for place in _PLACES for path in sorted(Path(place).glob("*/bin"), reverse=True)]
    return next((path for path in candidates if (path / "initdb").exists() and (path / "pg_ctl").exists()), None)


@contextmanager
def postgres_url(settings: Sequence[str] = ("fsync=off",)) -> Iterator[str]:
    """Run a server for as long as the context lasts; it takes no TCP port."""
    with postgres_server(settings) as server:
        yield server.url


@dataclass(frozen=True, kw_only=True)
class Server:
    """A server that can be stopped and started again."""

    url: str
    data: Path  #: folder of the database
    control: Callable[[list[str]], None]  #: runs pg_ctl
    start_arguments: list[str]

    def stop(self) -> None:
        """End it and all connections at once."""
        self.control(["-m", "fast", "stop"])

    def start(self) -> None:
        """Start it again."""
        self.control(self.start_arguments)


@contextmanager
def postgres_server(settings: Sequence[str] = ("fsync=off",)) -> Iterator[Server]:
    """Run a server for as long as the context lasts; it takes no TCP port."""
    programs = postgres_programs()
    assert programs is not None
    user = "postgres" if os.geteuid() == 0 else None  # the server refuses to run as root
    with tempfile.TemporaryDirectory(prefix="pg") as name:
        folder, data = Path(name), Path(name) / "data"
        if user:
            shutil.chown(folder, user)
        socket = f"-c listen_addresses= -c unix_socket_directories={folder} " + "".join(
            f" -c {setting}" for setting in settings
        )
        start = ["start", "-w", "-l", str(folder / "server.log"), "-o", socket]
        made: list[Path | str] = [
            programs / "initdb",
            "-D",
            data,
            "-U",
            "tester",
            "--auth=trust",
            "--no-sync",
            "-E",
            "UTF8",
        ]
        _run(made, user)

        def control(arguments: list[str]) -> None:
            _run([programs / "pg_ctl", "-D", data, *arguments], user)

        control(start)
        try:
            url = f"postgresql://tester@/postgres?host={folder}"
            yield Server(url=url, data=data, control=control, start_arguments=start)
        finally:
            control(["-m", "immediate", "stop"])


def _run(command: list[Path | str], user: str | None) -> None:
    subprocess.run(
        command, user=user, check=True, cwd="/", stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=60
    )
