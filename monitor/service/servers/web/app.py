"""The routes."""

from collections.abc import Awaitable, Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from monitor.service.operator_commands import Acknowledgement, write_command
from monitor.service.servers.web.alarm_reports import AlarmReports
from monitor.service.servers.web.auth import REPORT_POLICY, Guard, user_of
from monitor.service.servers.web.influx import influx_lines
from monitor.service.servers.web.metrics import metrics
from monitor.service.servers.web.snapshot import Snapshot
from monitor.service.servers.web.source import Source, problems
from monitor.service.servers.web.status_page import page_html, state_html

_STATIC = Path(__file__).parent / "static"
_TYPES = {".css": "text/css", ".js": "text/javascript"}
_Endpoint = Callable[[Request], Awaitable[Response]]


def make_app(source: Source, *, token: str, open_to_look: bool) -> ASGIApp:
    """Return the application: answers are computed once per second at most, for any number of requests."""
    state = Snapshot(lambda: state_html(source))
    problem_list = Snapshot(lambda: problems(source.status()))
    figures = Snapshot(lambda: metrics(source.status()))
    reports = AlarmReports(source)
    points = Snapshot(lambda: influx_lines(source.status(), source.name))

    async def page(_: Request) -> Response:
        return HTMLResponse(page_html(source.name, await state.get()))

    async def changing(_: Request) -> Response:
        return HTMLResponse(await state.get())

    async def healthz(_: Request) -> Response:
        found = await problem_list.get()
        return JSONResponse({"healthy": not found, "problems": found}, 503 if found else 200)

    async def prometheus(_: Request) -> Response:
        return Response(await figures.get(), media_type="text/plain; version=0.0.4")

    async def influx(_: Request) -> Response:
        return PlainTextResponse(await points.get())

    def acknowledge(request: Request) -> Response:
        by = (request.query_params.get("by") or user_of(request) or "status page")[:100]
        try:
            write_command(source.state, Acknowledgement(by=by, note=request.query_params.get("note", "")[:1000]))
        except OSError as error:
            return PlainTextResponse(f"the state folder is not writable: {error.strerror}\n", 503)
        return JSONResponse({"acknowledged": True}, 202)

    async def report(request: Request) -> Response:
        page = await reports.get(request.path_params["raised"])
        if page is None:
            return PlainTextResponse("the history has no diagnosis of this alarm\n", 404)
        return HTMLResponse(page, headers={"Content-Security-Policy": REPORT_POLICY})

    routes = [
        Route("/", page),
        Route("/state", changing),
        Route("/healthz", healthz),
        Route("/metrics", prometheus),
        Route("/influx", influx),
        Route("/report/{raised:int}", report),
        Route("/acknowledge", acknowledge, methods=["POST"]),
        Route("/page.css", static_file(_STATIC / "page.css")),
        Route("/page.js", static_file(_STATIC / "page.js")),
    ]
    return Guard(Starlette(routes=routes), token=token, open_to_look=open_to_look)


def static_file(path: Path) -> _Endpoint:
    """Return the endpoint of a file of the package."""
    content, kind = path.read_bytes(), _TYPES[path.suffix]

    async def static(_: Request) -> Response:
        return Response(content, media_type=kind)

    return static
