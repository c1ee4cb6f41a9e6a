"""The routes."""

from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from monitor.inbox import Acknowledgement, leave
from monitor.web.guard import Guard, user_of
from monitor.web.metrics import metrics
from monitor.web.page import page_html, state_html
from monitor.web.source import Source, problems

_STATIC = Path(__file__).parent / "static"


def make_app(source: Source, *, token: str, open_to_look: bool) -> Starlette:
    """Return the application; handlers are plain functions, run in threads, as they read files and the database."""

    def page(_: Request) -> Response:
        return HTMLResponse(page_html(source))

    def state(_: Request) -> Response:
        return HTMLResponse(state_html(source))

    def healthz(_: Request) -> Response:
        found = problems(source.vitals())
        return JSONResponse({"healthy": not found, "problems": found}, 503 if found else 200)

    def figures(_: Request) -> Response:
        return Response(metrics(source.vitals()), media_type="text/plain; version=0.0.4")

    def acknowledge(request: Request) -> Response:
        by = (request.query_params.get("by") or user_of(request) or "status page")[:100]
        try:
            leave(source.state, Acknowledgement(by=by, note=request.query_params.get("note", "")[:1000]))
        except OSError as error:
            return PlainTextResponse(f"the state folder takes nothing: {error.strerror}\n", 503)
        return JSONResponse({"told": True}, 202)

    def static(request: Request) -> Response:
        return FileResponse(_STATIC / Path(request.url.path).name)

    routes = [
        Route("/", page),
        Route("/state", state),
        Route("/healthz", healthz),
        Route("/metrics", figures),
        Route("/acknowledge", acknowledge, methods=["POST"]),
        Route("/page.css", static),
        Route("/page.js", static),
    ]
    return Starlette(routes=routes, middleware=[Middleware(Guard, token=token, open_to_look=open_to_look)])
