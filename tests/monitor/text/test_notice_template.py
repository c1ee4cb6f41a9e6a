"""Templates of notices are bounded in time, memory and output; settings attached to a log are not rendered at all."""

import json
import time
from pathlib import Path

import pytest

from daq import Channel, McapWriter
from monitor.analysis.logs import log_channels
from monitor.settings import parse_attached
from monitor.text.notice_template import TemplateFailure, render_bounded
from monitor.text.notices import Notice, check_template, message

NOTICE = Notice(kind="alarm", site="bridge", time=0, utc="then", state="alarm", text="a mass was added")
LOOPS = "{% for a in range(99999) %}{% for b in range(99999) %}{% endfor %}{% endfor %}"
HOSTILE = [
    (LOOPS, "2 s of processor time"),
    ("{{ '%999999999d' % 5 }}", "MB"),
    ("{{ 'x' * 199999 }}", "characters"),
    ("{% for a in range(99999) %}{{ notice.text }}{% endfor %}", "characters"),
    ("{{ notice.__class__.__mro__ }}", "unsafe"),
    ("{{ " + "(" * 3000 + ")" * 3000 + " }}", ""),
    ("x" * 30_000, "expected up to 20000 characters"),
]


@pytest.mark.parametrize(("template", "stated"), HOSTILE)
def test_hostile_templates_are_refused(template: str, stated: str) -> None:
    begun = time.monotonic()
    with pytest.raises(ValueError, match="expected a jinja2 template") as refused:
        check_template(template)
    assert stated in str(refused.value)
    assert time.monotonic() - begun < 30


def test_failed_template_is_replaced_by_the_default_text() -> None:
    stated = message([NOTICE], "{{ notice.none.none }}").text
    assert stated.startswith("bridge, then: a mass was added")
    assert "template has failed" in stated


def test_notice_variables_are_available_in_templates() -> None:
    template = "{% for n in notices %}{{ n.site }}: {{ n.text }} ({{ others }}){% endfor %} {{ notice.kind }}"
    assert message([NOTICE], template, 3).text == "bridge: a mass was added (3) alarm"
    with pytest.raises(TemplateFailure, match="'nothing'"):
        render_bounded("{{ notice.nothing }}", [{"notice": NOTICE.values()}])


def test_packages_from_pythonpath_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installation in PYTHONPATH or in the user's site has templates too."""
    (tmp_path / "sitecustomize.py").write_text(f"open({str(tmp_path / 'seen')!r}, 'w').close()", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert render_bounded("{{ notice }} in PYTHONPATH", [{"notice": "found"}]) == ("found in PYTHONPATH",)
    assert (tmp_path / "seen").exists()


SITE = f"""structure = "t.toml"
[[device]]
name = "imu"
driver = "epson-uart"
port = "p"
channels = {{x = "a"}}
[[notify]]
command = ["true"]
template = {json.dumps(LOOPS)}
"""


def test_settings_of_a_log_are_read_without_notices(tmp_path: Path) -> None:
    begun = time.process_time()
    assert parse_attached(SITE).notify == ()
    path = tmp_path / "log.mcap"
    McapWriter(path, {"site.toml": SITE}).close()
    assert log_channels(path) == (Channel(name="a", device="imu", axis=0),)
    assert time.process_time() - begun < 1.0
