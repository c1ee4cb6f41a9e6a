"""Access rights: loopback may read; actions, and reading from elsewhere, require the token."""

import base64
import os
import secrets
import sys
import time
from pathlib import Path

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_REPORT_SECONDS = 60.0
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none'; "
    "form-action {forms}; frame-ancestors 'none'"
)
#: policy of a report: its style and its pictures are in the page
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; frame-ancestors 'none'"
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def read_token(path: Path) -> str:
    """Return the token in a file that only its owner reads; one is drawn where there is none."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(secrets.token_urlsafe(24) + "\n")
    token = path.read_text(encoding="utf-8").strip()
    if len(token) < 16:
        raise ValueError(f"{path}: expected a token of at least 16 characters, found {len(token)}")
    return token


class Guard:
    """Lets a request through, or refuses it; sets the headers that keep a browser from harm.

    Parameters
    ----------
    app : guarded application
    token : the password of any user, or a bearer token
    open_to_look : whether reading requires no token: only if the port is reachable from this machine only
    token_place : place of the token, for the answer to a request without it
    search : whether a page has a form to search
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        token: str,
        open_to_look: bool,
        token_place: str = "web_token in the state folder, or web.token_file",
        search: bool = False,
    ) -> None:
        self._app, self._token, self._open, self._token_place = app, token, open_to_look, token_place
        policy = _POLICY.format(forms="'self'" if search else "'none'")
        self._headers = {"Content-Security-Policy": policy} | _HEADERS
        self._report_due = 0.0  # [s, monotonic]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or hand it on."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        begun = False

        async def send_guarded(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in self._headers.items():
                    headers.setdefault(name, value)
                begun = True
            await send(message)

        try:
            await (self._refusal(Request(scope)) or self._app)(scope, receive, send_guarded)
        except Exception as error:  # noqa: BLE001 - the edge of the server: no visitor fills the journal
            self._report(error)
            if not begun:
                await PlainTextResponse("internal error\n", 500)(scope, receive, send_guarded)

    def _report(self, error: Exception) -> None:
        """Write an unforeseen error as one line to standard error, once a minute at most."""
        if time.monotonic() >= self._report_due:
            self._report_due = time.monotonic() + _REPORT_SECONDS
            text = "".join(c if c.isprintable() else " " for c in str(error))[:200]
            print(f"status page: {type(error).__name__}: {text}", file=sys.stderr, flush=True)  # noqa: T201

    def _refusal(self, request: Request) -> PlainTextResponse | None:
        looks = request.method in ("GET", "HEAD")
        try:
            host = request.url.hostname
        except ValueError:
            return PlainTextResponse("this is the name of no machine\n", 400)
        if self._open and host not in ("127.0.0.1", "localhost", "::1"):
            return PlainTextResponse("this is not the name of this machine\n", 421)  # a page elsewhere gave us its name
        if not (looks and self._open) and not secrets.compare_digest(_given(request).encode(), self._token.encode()):
            ask = {"WWW-Authenticate": 'Basic realm="modalwatch: any name, the token as password"'}
            return PlainTextResponse(f"this requires the token: {self._token_place}\n", 401, headers=ask)
        if not looks and "x-modalwatch" not in request.headers:  # which no page elsewhere can set
            return PlainTextResponse("expected the header X-Modalwatch\n", 403)
        return None


def user_of(request: Request) -> str:
    """Return the name given with the token; empty for none."""
    return _basic(request)[0]


def _given(request: Request) -> str:
    kind, _, rest = request.headers.get("authorization", "").partition(" ")
    return rest.strip() if kind.lower() == "bearer" else _basic(request)[1]


def _basic(request: Request) -> tuple[str, str]:
    """Return user and password; empty where none are given."""
    kind, _, rest = request.headers.get("authorization", "").partition(" ")
    try:
        user, _, password = base64.b64decode(rest, validate=True).decode().partition(":")
    except ValueError:  # no base64, or no UTF-8 in it
        return "", ""
    return (user, password) if kind.lower() == "basic" else ("", "")
