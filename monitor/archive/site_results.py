"""Results of one site: a log of events and results, a history and the saved state, extended log by log."""

from itertools import islice
from pathlib import Path
from typing import Self

from daq import McapWriter
from monitor.archive.evaluation import EvaluatedLog
from monitor.archive.log_texts import LogTexts
from monitor.outputs.history import HistoryStore
from monitor.results.events import is_result
from monitor.watch.memory import MEMORY

RESULTS_LOG = "results.mcap"  #: of a site: events and results of all its logs, without signals
_BATCH = 200  # results that are put into the history at once


class SiteResults:
    """Results of a site, begun anew.

    Parameters
    ----------
    folder : of the site's results
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writer: McapWriter | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Finish the log of results, after the last log of the site."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def add(self, texts: LogTexts, found: EvaluatedLog) -> None:
        """Add a log."""
        if self._writer is None:
            self._writer = self._begin(texts)
        with HistoryStore(f"sqlite:///{self._folder / 'history.sqlite'}") as history:
            events = found.events
            while batch := list(islice(events, _BATCH)):
                for event in batch:
                    self._writer.write(event)
                history.write([event for event in batch if is_result(event)])
        if found.memory:
            (self._folder / MEMORY).write_text(found.memory, encoding="utf-8")

    def _begin(self, texts: LogTexts) -> McapWriter:
        self._folder.mkdir(parents=True, exist_ok=True)
        for name in ("history.sqlite", RESULTS_LOG):
            (self._folder / name).unlink(missing_ok=True)
        attached = {"site.toml": texts.site, "structure.toml": texts.structure, MEMORY: texts.memory}
        return McapWriter(self._folder / RESULTS_LOG, {name: text for name, text in attached.items() if text})
