"""Outputs of a run: history, notices, Home Assistant, pages and the live view; each may fail or be replaced."""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import Self

from daq import Item
from daq.events import EventPayload
from daq.supervision import FAILURES, error_text
from monitor.errors import StartError
from monitor.outputs.history import HistoryRecorder, SiteState
from monitor.outputs.home_assistant import HomeAssistant
from monitor.outputs.notices import NoticeSender
from monitor.outputs.site_report import SiteReporter
from monitor.results.service_events import ViewerFailed, ViewerRecovered, WebFailed, WebRecovered
from monitor.results.site_status import SiteStatus
from monitor.service.servers.live_view import LiveView
from monitor.service.servers.web import WebServer, web_process
from monitor.service.servers.web.source import problems
from monitor.service.site import Site

_AGAIN_SECONDS = 60.0  # interval until a failed server is restarted


class Outputs:
    """All of them; `put` is for the log's thread, the rest for the one that made it.

    Parameters
    ----------
    site : that is watched
    live : the live view, started elsewhere; None for none
    """

    def __init__(self, site: Site, live: LiveView | None) -> None:
        self._site, self._live = site, live
        self._history, self._senders, self._home = _history(site), _senders(site), _home(site)
        self._reporter = SiteReporter()
        self._web = ExitStack()
        self._server: WebServer | None = None
        self._web_failed: str | None = None  # why there is no server
        self._dead: dict[str, float] = {}  # failed server -> time of the next attempt, by time.monotonic [s]

    def __enter__(self) -> Self:
        """Start all but the live view.

        Raises
        ------
        StartError
            If the pages cannot be served.
        """
        with ExitStack() as stack:
            stack.callback(lambda: _stop([self._history, *self._senders, *self._home]))
            _start([self._history, *self._senders, *self._home])
            stack.callback(lambda: self._web.close())
            self._serve()
            self._undo = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """Write the waiting items, and end."""
        self._undo.close()

    def put(self, item: Item) -> None:
        """Pass on a logged item; never blocks."""
        FAILURES.attempt("history", self._history.put, item)
        FAILURES.attempt("report", self._reporter.take, item)
        for sender in self._senders:
            FAILURES.attempt("notices", sender.put, item)
        self.show(item)

    def show(self, item: Item) -> None:
        """Pass on an item that is not logged, for the live view alone; never blocks."""
        if self._live:
            FAILURES.attempt("viewer", self._live.show, item)

    def put_status(self, status: SiteStatus) -> None:
        """Pass on the state of the run, for Home Assistant and for pages of many sites; never blocks."""
        web, window = self._site.settings.web, status.window
        state = SiteState(
            state=status.state,
            window=window.end if window else None,
            window_age=status.window_age if window else None,
            overdue=status.window_overdue,
            problems=tuple(problems(status)),
            url=(web.url if web else None) or "",
        )
        self._history.put_state(state)
        for home in self._home:
            home.show(status, self._reporter.report(self._site.writer.site or self._site.name, state))

    def events(self) -> Iterator[EventPayload]:
        """Yield events since the last call; failed servers are restarted after a while."""
        yield from self._history.events()
        for sender in self._senders:
            yield from sender.events()
        for home in self._home:
            yield from home.events()
        yield from self._tend()

    def _tend(self) -> Iterator[EventPayload]:
        """Report once which server has failed and why; restart it a minute later."""
        now = time.monotonic()
        for name, problem, again, failed, recovered in (
            ("viewer", self._live.problem if self._live else None, self.show_again, ViewerFailed, ViewerRecovered),
            ("web", self._web_problem, self._serve_again, WebFailed, WebRecovered),
        ):
            if problem and name not in self._dead:
                self._dead[name] = now + _AGAIN_SECONDS
                yield failed(why=problem)
            elif name in self._dead and now >= self._dead[name]:
                self._dead[name] = now + _AGAIN_SECONDS
                if again() is None:
                    del self._dead[name]
                    yield recovered()

    def show_again(self) -> str | None:
        """Restart the live view, without earlier data; return the reason of a failure."""
        if self._live:
            self._live.restart(self._site.settings, self._site.structure_text, self._site.site_text)
        return self._live.problem if self._live else None

    def _serve_again(self) -> str | None:
        """Serve the pages again; return why that cannot be."""
        self._web.close()
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001 - tried again a minute later, whatever it is
            self._web_failed = str(error) if isinstance(error, StartError) else error_text(error)
        return self._web_problem

    @property
    def _web_problem(self) -> str | None:
        return self._server.problem if self._server else self._web_failed

    @property
    def waiting(self) -> int:
        """Items that the live view has not taken yet."""
        return self._live.waiting if self._live else 0

    @property
    def history_dropped(self) -> int:
        """Items that the history did not store or spool."""
        return self._history.dropped

    @property
    def problems(self) -> dict[str, str | None]:
        """Problem of each output, None while it works."""
        troubled = "; ".join(sender.problem for sender in self._senders if sender.problem)
        return {
            "history": self._history.problem,
            "notices": troubled or None,
            "home_assistant": next((home.problem for home in self._home), None),
            "viewer": self._live.problem if self._live else None,
            "web": self._web_problem,
        }

    def renew(self, site: Site, *, analysed_alike: bool) -> Iterator[str]:
        """Replace the outputs whose settings have changed; yield their names, or the reason of a failure.

        New items for history and notices wait meanwhile: the old ones may still write to shared files.
        """
        before, now = self._site.settings, site.settings
        self._site = site
        if before.history != now.history:
            old, self._history = self._history, _history(site)
            _stop([old])
            _start([self._history])
            yield "history"
        if before.notify != now.notify:
            self._renew_senders()
            yield "notify"
        if before.home_assistant != now.home_assistant:
            old_home, self._home = self._home, _home(site)
            _stop(old_home)
            _start(self._home)
            yield "home_assistant"
        if before.web != now.web:
            why = self._serve_again()
            yield f"no web: {why}" if why else "web"
        if self._live and (before.viewer != now.viewer or (now.viewer and not analysed_alike)):
            self._live.restart(now, site.structure_text, site.site_text)
            yield "viewer"

    def _renew_senders(self) -> None:
        old, new = self._senders, _senders(self._site)
        for sender, former in zip(new, old, strict=False):
            sender.continue_from(former)
        self._senders = new
        for sender in old:
            sender.stop()  # not waited for: each new one delivers only once the old one has ended
        _start(new)

    def _serve(self) -> None:
        """Serve the pages, if the site has any.

        Raises
        ------
        StartError
            If they cannot be served.
        """
        web, self._server, self._web_failed = self._site.settings.web, None, None
        if web:
            server = web_process(self._site.source, web.bind, web.port, web.token_file)
            self._server = self._web.enter_context(server)


Part = HistoryRecorder | NoticeSender | HomeAssistant


def _start(parts: Sequence[Part]) -> None:
    for part in parts:
        part.__enter__()


def _stop(parts: Sequence[Part]) -> None:
    """End parts; none waits for another's end."""
    for part in parts:
        part.stop()
    for part in parts:
        part.__exit__()


def _history(site: Site) -> HistoryRecorder:
    spool, settings = site.state / "history_spool.jsonl", site.settings.history
    return HistoryRecorder(
        site.source.url,
        spool,
        keep_events=settings.keep_events,
        keep_days=settings.keep_days,
        writer=site.writer,
    )


def _senders(site: Site) -> list[NoticeSender]:
    targets = enumerate(site.settings.notify, 1)
    return [NoticeSender(target, site.state / f"notices_{number}.jsonl", site.name) for number, target in targets]


def _home(site: Site) -> list[HomeAssistant]:
    """Return the publisher for Home Assistant; none if that is not configured."""
    settings = site.settings.home_assistant
    return [HomeAssistant(settings, site.name)] if settings else []
