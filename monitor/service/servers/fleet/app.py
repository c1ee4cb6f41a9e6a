"""The page of many sites: its routes, and its server."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from ipaddress import ip_address
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from daq.signals import STOP_SIGNALS, signal_event
from monitor.errors import StartError
from monitor.outputs.fleet_broker import FleetBroker, FleetBrokerError
from monitor.outputs.history import STATE_SECONDS, FleetReader, FleetRow, HistoryError, Reader
from monitor.service.processes import spare_what_is_loaded
from monitor.service.servers import web
from monitor.service.servers.fleet.overview import CONDITIONS, Wanted, overview
from monitor.service.servers.fleet.pages import SPANS, failed_html, fleet_html, site_html, sites_html
from monitor.service.servers.web.app import static_file
from monitor.service.servers.web.auth import Guard, read_token
from monitor.service.servers.web.process import bounded_server, listen, page_url
from monitor.service.servers.web.snapshot import Snapshot
from monitor.service.systemd.notify import ServiceManager
from monitor.settings.fleet import FleetSettings
from monitor.settings.redaction import revealed

_STATIC = Path(__file__).parent / "static"
_PAGE_CSS = Path(web.__file__).parent / "static" / "page.css"
_MAX_WORDS = 200  # characters


@dataclass(frozen=True, kw_only=True)
class FleetSource:
    """Data of the pages: a database, a broker or both, and what the settings know of the sites."""

    reader: FleetReader | None  #: of the database
    broker: FleetBroker | None = None  #: its states replace those of the database, unless only these are recent
    url: str = field(default="", repr=False)  #: address of the database, with its password
    pages: Mapping[str, str] = field(default_factory=dict)  #: address of the status page of a site, by name
    hidden: tuple[str, ...] = ()  #: names of sites that are not shown

    def sites(self) -> list[FleetRow]:
        """Return the sites that are shown."""
        rows = {row.name: row for row in (self.reader.sites() if self.reader else ())}
        for row in self.broker.sites() if self.broker else ():
            known = rows.get(row.name)
            if known and known.state and known.age <= STATE_SECONDS < row.age:
                continue  # its monitor has left the broker
            rows[row.name] = replace(row, number=known.number) if known else row
        return [row for name, row in sorted(rows.items()) if name not in self.hidden]

    def content(self, rows: list[FleetRow], wanted: Wanted) -> str:
        """Return the changing part of the page."""
        found = overview(rows, wanted)
        numbers = [view.row.number for view in found.shown]
        levels = self.reader.levels([number for number in numbers if number > 0]) if self.reader else {}
        levels |= self.broker.levels([number for number in numbers if number < 0]) if self.broker else {}
        return sites_html(found, wanted, levels, self.pages)

    def site(self, row: FleetRow, span: str) -> str:
        """Return the page of a site."""
        with Reader(self.url, row.name) as reader:
            return site_html(reader, row, span)


def make_fleet_app(source: FleetSource, *, token: str, open_to_look: bool, token_place: str = "") -> ASGIApp:
    """Return the application: the states are read once per second at most, for any number of requests."""
    rows = Snapshot(source.sites)

    async def content(request: Request) -> tuple[str, int]:
        try:
            return await run_in_threadpool(source.content, await rows.get(), _wanted(request)), 200
        except (HistoryError, FleetBrokerError) as error:
            return failed_html(str(error)), 503

    async def page(request: Request) -> Response:
        html, code = await content(request)
        return HTMLResponse(fleet_html(_wanted(request), html), code)

    async def changing(request: Request) -> Response:
        return HTMLResponse(*(await content(request)))

    async def site(request: Request) -> Response:
        span = request.query_params.get("span", "day")
        try:
            number = int(request.path_params["number"])
            found = [row for row in await rows.get() if row.number == number and number > 0]
            if not found or span not in SPANS:
                return PlainTextResponse("there is no such page\n", 404)
            return HTMLResponse(await run_in_threadpool(source.site, found[0], span))
        except (HistoryError, FleetBrokerError) as error:
            return HTMLResponse(fleet_html(Wanted(), failed_html(str(error))), 503)

    async def healthz(_: Request) -> Response:
        try:
            await rows.get()
        except (HistoryError, FleetBrokerError) as error:
            return JSONResponse({"healthy": False, "problems": [str(error)]}, 503)
        return JSONResponse({"healthy": True, "problems": []})

    routes = [
        Route("/", page),
        Route("/sites", changing),
        Route("/site/{number:int}", site),
        Route("/healthz", healthz),
        Route("/page.css", static_file(_PAGE_CSS)),
        Route("/fleet.css", static_file(_STATIC / "fleet.css")),
        Route("/fleet.js", static_file(_STATIC / "fleet.js")),
    ]
    app = Starlette(routes=routes)
    return Guard(app, token=token, open_to_look=open_to_look, token_place=token_place, search=True)


def _wanted(request: Request) -> Wanted:
    condition, page = request.query_params.get("state", ""), request.query_params.get("page", "1")
    return Wanted(
        words=request.query_params.get("q", "")[:_MAX_WORDS],
        condition=condition if condition in CONDITIONS else "",
        page=int(page) if page.isascii() and page.isdigit() and len(page) < 6 else 1,
    )


def serve_fleet(settings: FleetSettings, folder: Path, ready: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM.

    Parameters
    ----------
    settings : of the page
    folder : that the file of the token is relative to
    ready : called with the address of the page

    Raises
    ------
    HistoryError, FleetBrokerError
        If the database cannot be read, or is no PostgreSQL; if the broker does not respond.
    StartError
        If the port is taken or the token cannot be used.
    """
    url, mqtt, local = revealed(settings.url), revealed(settings.mqtt), ip_address(settings.bind).is_loopback
    with ExitStack() as stack:
        reader = stack.enter_context(FleetReader(url)) if url else None
        broker = stack.enter_context(FleetBroker(mqtt)) if mqtt else None
        stack.enter_context(signal_event(*STOP_SIGNALS))
        source = FleetSource(reader=reader, broker=broker, url=url, pages=settings.pages, hidden=settings.hidden)
        try:
            token = read_token(folder / settings.token_file)
            listener = listen(settings.bind, settings.port)
        except (OSError, ValueError) as error:
            raise StartError(f"fleet: {settings.bind}:{settings.port}: {error}") from error
        app = make_fleet_app(source, token=token, open_to_look=local, token_place=settings.token_file)
        with listener:
            spare_what_is_loaded()
            ready(page_url(settings.bind, listener.getsockname()[1]))
            manager = ServiceManager()
            manager.ready()
            bounded_server(app).run(sockets=[listener])
            manager.stopping()
