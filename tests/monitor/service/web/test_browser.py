"""The status page in a real browser: it renews itself, and its button reaches the monitor."""

import base64
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from daq import SystemClock
from monitor.outputs.history import HistoryStore
from monitor.results.site_status import FILE_NAME
from monitor.service.operator_commands import Inbox
from monitor.service.servers.web import Source, web_process
from monitor.service.status import MonitorStatus
from tests.support.browser import BROWSER, Tab, browser_tab
from tests.support.monitor.history import run_events, sqlite_url
from tests.support.monitor.service.status import PACE, WELL

pytestmark = [pytest.mark.live, pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")]
PORT = 20_000 + (os.getpid() + 10_000) % 20_000
BUTTON = "document.querySelector('[data-acknowledge]')"


@pytest.fixture
def tab(tmp_path: Path) -> Iterator[Tab]:
    """Return the page of a monitor that has found a mass."""
    events = run_events()
    with HistoryStore(sqlite_url(tmp_path)) as store:
        store.write(events)
    status = MonitorStatus(tmp_path / FILE_NAME, (), PACE, SystemClock())
    for event in events:
        status.take(event)
    status.write(*WELL)
    source = Source(name="bridge", state=tmp_path, url=sqlite_url(tmp_path))
    with web_process(source, "127.0.0.1", PORT, None) as server, browser_tab(tmp_path / "profile") as opened:
        opened.call("Page.navigate", url=server.url)
        yield opened


def renewal(tab: Tab) -> None:
    """Wait until the page has been renewed."""
    before = tab.value("document.getElementById('link').textContent")
    tab.until(f"document.getElementById('link').textContent != {before!r}")


def test_page_refreshes_itself_and_its_button_acknowledges_the_alarm(tab: Tab, tmp_path: Path) -> None:
    tab.until("document.getElementById('link')?.textContent.startsWith('live, renewed')")  # its own policy lets it
    assert "ALARM: the structure has changed" in tab.value("document.body.innerText")
    assert tab.value("document.querySelectorAll('.member').length") > 0
    token = base64.b64encode(f"ada:{(tmp_path / 'web_token').read_text().strip()}".encode()).decode()
    tab.call("Network.enable")
    tab.call("Network.setExtraHTTPHeaders", headers={"Authorization": f"Basic {token}"})
    (tmp_path / "inbox").write_text("no folder")
    tab.value(f"{BUTTON}.click()")
    tab.until(f"{BUTTON}.textContent.startsWith('Refused: the state folder is not writable')")
    renewal(tab)
    assert tab.value(f"{BUTTON}.textContent").startswith("Refused")  # what is put in anew says it too
    (tmp_path / "inbox").unlink()
    tab.value(f"{BUTTON}.click()")
    tab.until(f"{BUTTON}.textContent == 'Acknowledgement sent' && {BUTTON}.disabled")
    assert [command.payload()["by"] for command in Inbox(tmp_path).taken()] == ["ada"]
