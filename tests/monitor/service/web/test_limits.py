"""The server against visitors who mean harm: odd headers, requests that do not end, more connections than it takes."""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
import uvicorn
from starlette.types import ASGIApp
from uvicorn.server import ServerState

from monitor.service.servers.web import Source, make_app, process
from monitor.service.servers.web.auth import Guard
from monitor.service.servers.web.process import BoundedProtocol
from monitor.service.servers.web.snapshot import Snapshot

TOKEN = "0123456789abcdef"
ODD = [
    b"Authorization: Basic \xe9",
    b"Authorization: Basic \xff\xfe\x80",
    b"Authorization: Basic w6k=w6k=w6k=",
    b"Authorization: Bearer \xe9",
    b"Authorization: \xc3\xa9",
    b"Host: [::1",
    b"Host: \xe9",
    b"Host: a:b:c",
]


@pytest.fixture
def app(tmp_path: Path) -> ASGIApp:
    return make_app(Source(name="bridge", state=tmp_path, url="sqlite:////none"), token=TOKEN, open_to_look=True)


Connect = Callable[[], Awaitable[tuple[asyncio.StreamReader, asyncio.StreamWriter]]]


def served(app: ASGIApp, visit: Callable[[Connect], Awaitable[None]]) -> None:
    """Let a client visit a server on its own port."""
    writers = []

    async def run() -> None:
        config = uvicorn.Config(app, http=BoundedProtocol, log_level="error", lifespan="off", server_header=False)
        config.load()
        state = ServerState()
        loop = asyncio.get_running_loop()
        server = await loop.create_server(lambda: BoundedProtocol(config, state, {}), "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]

        async def connect() -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writers.append(writer)
            return reader, writer

        async with server:
            await visit(connect)
            for writer in writers:
                writer.close()
            while state.connections:
                await asyncio.sleep(0.01)

    asyncio.run(run())


async def answer(reader: asyncio.StreamReader) -> bytes:
    """Return what is said until the end; empty for a connection that is cut."""
    try:
        return await asyncio.wait_for(reader.read(), 5.0)
    except ConnectionError:
        return b""


@pytest.mark.parametrize("line", ODD)
def test_invalid_headers_are_refused_with_security_headers(
    app: ASGIApp, line: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    async def visit(connect: Connect) -> None:
        reader, writer = await connect()
        host = b"" if line.startswith(b"Host") else b"Host: 127.0.0.1\r\n"
        writer.write(b"POST /acknowledge HTTP/1.1\r\nConnection: close\r\n" + host + line + b"\r\n\r\n")
        head = await answer(reader)
        assert head.split()[1] in {b"400", b"401", b"421"}, head
        assert b"x-content-type-options: nosniff" in head.lower() or b"Invalid HTTP request" in head

    served(app, visit)
    assert capfd.readouterr().err == ""


def test_internal_error_is_one_log_line_and_keeps_security_headers(capfd: pytest.CaptureFixture[str]) -> None:
    async def broken(*_: object) -> None:
        raise KeyError("\x1b[31mwhat\nnow")

    async def asked() -> httpx.Response:
        guard = Guard(broken, token=TOKEN, open_to_look=True)
        async with httpx.AsyncClient(transport=httpx.ASGITransport(guard), base_url="http://127.0.0.1") as client:
            await client.get("/")
            return await client.get("/")

    found = asyncio.run(asked())
    assert (found.status_code, found.headers["x-content-type-options"]) == (500, "nosniff")
    assert capfd.readouterr().err.splitlines() == [r"status page: KeyError: '\x1b[31mwhat\nnow'"]


def test_only_an_unfinished_request_is_disconnected_after_its_time_limit(
    app: ASGIApp, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slow bytes do not lengthen the time; a connection that is kept alive has it again after each response."""
    monkeypatch.setattr(process, "REQUEST_SECONDS", 0.4)

    async def visit(connect: Connect) -> None:
        (half, slow), (kept, asking) = [await connect() for _ in range(2)]
        slow.write(b"GET / HTTP/1.1\r\nX: ")
        for _ in range(3):
            asking.write(b"GET /page.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            head = await kept.readuntil(b"\r\n\r\n")
            await kept.readexactly(int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0]))
            slow.write(b"x")
            await asyncio.sleep(0.2)
        assert await answer(half) == b""
        assert BoundedProtocol.waiting
        assert await answer(kept) == b""  # nothing more was asked
        assert not BoundedProtocol.waiting

    served(app, visit)


def test_longest_waiting_connection_is_closed_above_the_limit(app: ASGIApp, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "MAX_CONNECTIONS", 3)

    async def visit(connect: Connect) -> None:
        opened = [await connect() for _ in range(5)]
        for _, writer in opened:
            writer.write(b"GET /page.js HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n")
        assert [await answer(reader) for reader, _ in opened[:2]] == [b"", b""]
        for reader, writer in opened[2:]:
            writer.write(b"\r\n")
            assert (await answer(reader)).startswith(b"HTTP/1.1 200")

    served(app, visit)


def test_snapshot_is_computed_once_per_period_and_never_outdated(monkeypatch: pytest.MonkeyPatch) -> None:
    now, calls, go = 0.0, 0, threading.Event()
    monkeypatch.setattr(
        "monitor.service.servers.web.snapshot.time", SimpleNamespace(monotonic=lambda: now)
    )  # not the loop's

    def compute() -> int:
        nonlocal calls
        calls += 1
        if calls > 1:
            assert go.wait(5.0)
        return calls

    async def look() -> None:
        nonlocal now
        snapshot = Snapshot(compute)
        assert await asyncio.gather(*(snapshot.get() for _ in range(100))) == [1] * 100
        now = 2.0
        assert await snapshot.get() == 1  # the next one is being computed
        now = 4.0
        late = asyncio.create_task(snapshot.get())
        await asyncio.sleep(0.01)
        assert not late.done()
        go.set()
        assert await late == 2
        assert calls == 2

    asyncio.run(look())
