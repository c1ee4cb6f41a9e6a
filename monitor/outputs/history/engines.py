"""Database engines by address, with bounded waiting times, and errors of the history."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

from pydantic import SecretStr
from sqlalchemy import URL, Connection, Engine, create_engine, event
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError
from sqlalchemy.pool import NullPool

from monitor.errors import MonitorError
from monitor.settings.redaction import masked, revealed


class HistoryError(MonitorError):
    """A database that cannot be opened, read or written.

    Parameters
    ----------
    url : of the database
    message : the fault
    unusable : whether its file is damaged, or no longer the one that was opened: waiting does not help
    """

    def __init__(self, url: str, message: str, *, unusable: bool = False) -> None:
        super().__init__(f"{url}: {message}")
        self.url, self.unusable = url, unusable


class OpenDatabase:
    """A database, open during a context."""

    url: str  #: address without secrets
    _engine: Engine

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connections."""
        self._engine.dispose()

    def _error(self, error: Exception) -> HistoryError:
        return HistoryError(self.url, error_message(error, self._engine.url))


_CACHE_KB = 512  # of pages that a connection to SQLite keeps; by itself it takes 2 MB, in hours
_BUSY_SECONDS = 1.0  # that another process may hold a SQLite file before writing is put off
_LOCK_SECONDS = 10.0  # longest time that a session of PostgreSQL may hold a required lock [s]
_PATIENCE = {  # libpq's, with a server that is not there any more: by the kernel's own measure that is hours
    "connect_timeout": 3,  # s
    "keepalives_idle": 10,  # s
    "keepalives_interval": 5,  # s
    "keepalives_count": 3,
    "tcp_user_timeout": 20_000,  # ms
}
_DRIVERS = {"postgresql": "postgresql+psycopg"}


def database_url(url: SecretStr | None, state: Path) -> str:
    """Return the address of the history: from the settings, or a SQLite file in the state folder."""
    return revealed(url) or f"sqlite:///{state / 'history.sqlite'}"


def open_engine(url: str, *, keep_connections: bool = True) -> Engine:
    """Return an engine without a connection.

    Parameters
    ----------
    url : of the database
    keep_connections : False to close a connection to a server after each use: a thousand monitors that write some
        times a minute need a handful of the server's connections instead of a thousand

    Raises
    ------
    HistoryError
        If the address makes no sense, or is of a kind that is not installed.
    """
    try:
        parsed = make_url(url)
        parsed = parsed.set(drivername=_DRIVERS.get(parsed.drivername, parsed.drivername))
        options = {"timeout": _BUSY_SECONDS} if parsed.get_backend_name() == "sqlite" else _PATIENCE
        pool = {} if keep_connections or parsed.get_backend_name() == "sqlite" else {"poolclass": NullPool}
        engine = create_engine(parsed, connect_args=options, pool_pre_ping=True, **pool)
    except (ArgumentError, NoSuchModuleError) as error:
        raise HistoryError(shown_url(url), "expected sqlite:///FILE or postgresql://USER@HOST/NAME") from error
    except ModuleNotFoundError as error:
        raise HistoryError(shown_url(url), f"{error.name} is not installed: pip install 'modalwatch[fleet]'") from error
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _set_pragmas)
    else:
        event.listen(engine, "begin", _wait_briefly)
    return engine


def file_of(url: str) -> Path | None:
    """Return the file of a SQLite database; None of any other."""
    try:
        parsed = make_url(url)
    except ArgumentError:
        return None
    return Path(parsed.database) if parsed.get_backend_name() == "sqlite" and parsed.database else None


def reading_engines(url: str) -> Iterator[Engine]:
    """Yield engines for questions, each where the last one could not: as for writing, read only, and as a copy.

    A SQLite file without write permission is read nevertheless; without a journal if nobody else writes either.
    """
    engine = open_engine(url)
    yield engine
    if engine.dialect.name == "sqlite" and engine.url.database:
        place = f"sqlite:///file:{quote(str(Path(engine.url.database).absolute()))}"
        for how in ("mode=ro", "immutable=1"):
            yield create_engine(f"{place}?{how}&uri=true")


def _set_pragmas(connection: Any, _record: object) -> None:  # noqa: ANN401 - sqlite3's or another driver's
    """Let readers read while one writes; a power cut may cost the last transaction, never the file."""
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=NORMAL")
    cursor.execute(f"PRAGMA cache_size={-_CACHE_KB}")
    cursor.close()


def _wait_briefly(connection: Connection) -> None:
    """Wait for short locks only, in this transaction; without one, in this session."""
    is_session = connection.get_execution_options().get("isolation_level") == "AUTOCOMMIT"
    scope = "SESSION" if is_session else "LOCAL"
    connection.exec_driver_sql(f"SET {scope} lock_timeout = {round(1000 * _LOCK_SECONDS)}")


def shown_url(url: str) -> str:
    """Return the address without user, password and query."""
    try:
        place = make_url(url)
    except (ArgumentError, ValueError):
        return f"{url.partition(':')[0]}:"
    return URL.create(place.drivername, host=place.host, port=place.port, database=place.database).render_as_string()


def error_message(error: Exception, place: URL) -> str:
    """Return an error of a database in one line, without the secrets of its address."""
    lines = str(getattr(error, "orig", None) or error).splitlines()
    if not lines:
        return type(error).__name__
    query = chain.from_iterable([value] if isinstance(value, str) else value for value in place.query.values())
    return masked(lines[0], filter(None, (place.username, place.password, *query)))
