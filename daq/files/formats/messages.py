"""Messages that libraries log while they read a file: remarks in place of lines on the terminal."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

_MAX_MESSAGES, _MAX_LENGTH = 3, 200


class _Collector(logging.Handler):
    """Handler that keeps the first messages."""

    def __init__(self, found: list[str]) -> None:
        super().__init__(logging.WARNING)
        self._found = found

    def emit(self, record: logging.LogRecord) -> None:
        text = " ".join(record.getMessage().split())[:_MAX_LENGTH]
        if len(self._found) < _MAX_MESSAGES and text not in self._found:
            self._found.append(text)


@contextmanager
def library_messages(package: str) -> Iterator[list[str]]:
    """Collect the warnings of all loggers of a package inside this context, in a list that it yields."""
    names = [name for name in logging.root.manager.loggerDict if name == package or name.startswith(f"{package}.")]
    loggers = [logging.getLogger(name) for name in names]
    before = [(logger, list(logger.handlers), logger.propagate) for logger in loggers]
    found: list[str] = []
    collector = _Collector(found)
    for logger in loggers:
        logger.handlers, logger.propagate = [collector], False
    try:
        yield found
    finally:
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate
