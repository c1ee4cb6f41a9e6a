"""Reports of alarms, drawn on request by a process of its own: drawing takes seconds, and memory that is given back."""

import asyncio
import json
import sys
import time

from monitor.service.servers.web.source import Source

_KEPT_SECONDS = 30.0  # that a report is given again: the diagnosis of an active alarm changes with each window
_MAX_SECONDS = 120.0
_CODE = "from monitor.service.servers.web.alarm_page import main; main()"


class AlarmReports:
    """Pages of alarms; one is drawn at a time.

    Parameters
    ----------
    source : with the history
    """

    def __init__(self, source: Source) -> None:
        self._source, self._lock = source, asyncio.Lock()
        self._raised, self._begun = 0, 0.0  # alarm of the last page [ns UTC], when it was begun [s, monotonic]
        self._page: asyncio.Task[bytes | None] | None = None

    async def get(self, raised: int) -> bytes | None:
        """Return the page of the alarm that was raised at a time [ns UTC]; None if the history has no diagnosis.

        A page whose visitor has left is completed for the next one.
        """
        async with self._lock:
            fresh = raised == self._raised and time.monotonic() - self._begun < _KEPT_SECONDS
            if self._page is None or not (fresh or (raised == self._raised and not self._page.done())):
                self._raised, self._begun = raised, time.monotonic()
                self._page = asyncio.create_task(self._draw(raised))
                self._page.add_done_callback(lambda task: task.cancelled() or task.exception())  # is raised below
            return await asyncio.shield(self._page)

    async def _draw(self, raised: int) -> bytes | None:
        source = self._source
        request = {"name": source.name, "url": source.url, "site": source.history_site, "raised": raised}
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(sys.executable, "-c", _CODE, stdin=pipe, stdout=pipe)
        try:
            page, _ = await asyncio.wait_for(process.communicate(json.dumps(request).encode()), _MAX_SECONDS)
        finally:
            if process.returncode is None:
                process.kill()
        if process.returncode:
            raise RuntimeError(f"the report of an alarm ended with exit code {process.returncode}")
        return page or None
