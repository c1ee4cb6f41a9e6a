"""Settings that raise any exception when they are read again: monitoring continues with the present ones."""

import json
import time
from pathlib import Path

import pytest

from monitor.service.log_and_analysis import new_analysis
from monitor.service.outputs import Outputs
from tests.support.monitor.runs import LawState, QuietWorker, watched_site
from tests.support.processes import script_process

NOTIFY = '[[notify]]\nwebhook = "http://127.0.0.1:1/x"\ntemplate = "{}"\n'
STRUCTURE, RECORDER = 'structure = "t_structure.toml"', "[recorder]"
HOSTILE = {  # what of the settings is replaced, and by what
    "nested": (STRUCTURE, STRUCTURE + "\nx = " + "[" * 20_000 + "]" * 20_000),
    "digits": (STRUCTURE, STRUCTURE + "\nx = " + "9" * 6000),
    "zero byte": (STRUCTURE, 'structure = "a\\u0000b.toml"'),
    "zero byte in a folder": (RECORDER, '[recorder]\nfolder = "a\\u0000b"'),
    "long folder": (RECORDER, f'[recorder]\nfolder = "{"a" * 5000}"'),
    "long key": (STRUCTURE, STRUCTURE + "\n" + "a" * 5000 + " = 1"),
    "long structure": (STRUCTURE, f'structure = "{"a" * 5000}"'),
    "KeyError": (RECORDER, NOTIFY.format("{{ {}.popitem() }}") + RECORDER),
    "IndexError": (RECORDER, NOTIFY.format("{{ notices.pop(5) }}") + RECORDER),
    "RecursionError": (RECORDER, NOTIFY.format("{% macro f() %}{{ f() }}{% endmacro %}{{ f() }}") + RECORDER),
    "bytes": (STRUCTURE, STRUCTURE + "\udc80"),
}


@pytest.mark.live
def test_monitoring_continues_with_the_present_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = watched_site(tmp_path, monkeypatch)
    script, now = Path(__file__).parents[2] / "support" / "daq" / "emulated_ports.py", time.time_ns()
    with script_process(script, 1, 1, now, now) as (_, reported):
        [port] = json.loads(reported)
        watched.write({"beam_left": (port, 500.0)})
        good = watched.path.read_text(encoding="utf-8")
        with watched.running() as ended:
            watched.until(lambda: watched.scans("beam_left"))
            for refused, (old, new) in enumerate(HOSTILE.values(), 1):
                watched.path.write_bytes(good.replace(old, new).encode(errors="surrogateescape"))
                watched.reload()
                watched.until_told("reload_refused", refused)
            watched.flows("beam_left")
            _fail_while_it_is_put_into_effect(watched, good, monkeypatch)
            watched.flows("beam_left")
            assert not ended.done()
            watched.stop()
            report = ended.result()
    for event in watched.events("reload_refused"):
        assert 20 < len(event.payload["why"]) < 800
        assert event.payload["why"].isprintable()
    assert report.disk_failure is None


def _fail_while_it_is_put_into_effect(watched: LawState, good: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts that fail when they are replaced cost no other part its change, and the log continues."""

    def fails(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(Outputs, "_renew_senders", fails)
    monkeypatch.setattr("monitor.service.log_and_analysis.new_analysis", fails)
    watched.path.write_text(
        good.replace("min_free_gb = 0", "min_free_gb = 0.001") + NOTIFY.format("x"), encoding="utf-8"
    )
    watched.reload()
    watched.until_told("reloaded", 1)
    [reloaded] = watched.events("reloaded")
    assert reloaded.payload["changed"] == "log and analysis"
    assert reloaded.payload["failed"].startswith("outputs: MemoryError (test_reload_refused.py:")
    assert watched.events("analysis_failed")[0].payload["why"] == "MemoryError"
    monkeypatch.setattr("monitor.service.log_and_analysis.new_analysis", new_analysis)
    watched.until(lambda: len(QuietWorker.made) == 2)
