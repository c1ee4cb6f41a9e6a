"""The server of the page of many sites, in this process."""

from collections.abc import Callable
from contextlib import ExitStack
from ipaddress import ip_address
from pathlib import Path

from daq.signals import STOP_SIGNALS, signal_event
from monitor.errors import StartError
from monitor.outputs.fleet_broker import FleetBroker
from monitor.outputs.history import FleetReader
from monitor.service.servers.fleet.app import FleetSource, make_fleet_app
from monitor.service.servers.web.auth import read_token
from monitor.service.servers.web.process import bounded_server, listen, page_url
from monitor.service.systemd.notify import ServiceManager
from monitor.settings.fleet import FleetSettings
from monitor.settings.redaction import revealed


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
            ready(page_url(settings.bind, listener.getsockname()[1]))
            manager = ServiceManager()
            manager.ready()
            bounded_server(app).run(sockets=[listener])
            manager.stopping()
