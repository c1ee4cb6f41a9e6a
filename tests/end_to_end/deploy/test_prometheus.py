"""The real Prometheus reads a monitor with the shipped settings: every query of the dashboard has data."""

import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.monitor.service.status import served_run
from tests.support.processes import free_port, server_process

DEPLOY = Path(__file__).parents[3] / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana" / "dashboards" / "modalwatch.json").read_text(encoding="utf-8"))
QUERIES = [
    pytest.param(target["expr"], id=f"{panel['title']} {target['refId']}")
    for panel in DASHBOARD["panels"]
    for target in panel["targets"]
]
TARGET = "monitor:8765"

pytestmark = [
    pytest.mark.skipif(
        not (shutil.which("prometheus") and shutil.which("promtool")),
        reason="prometheus and promtool are not installed",
    ),
    pytest.mark.xdist_group("prometheus"),  # one server for all
]


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the shipped settings, as the container has it."""
    folder = tmp_path_factory.mktemp("prometheus")
    for name in ("prometheus.yml", "modalwatch.rules.yml"):
        shutil.copy(DEPLOY / name, folder)
    (folder / "web_token").write_text("0123456789abcdef\n")
    return folder


class Api:
    """HTTP API of a Prometheus."""

    def __init__(self, port: int) -> None:
        self._url = f"http://127.0.0.1:{port}/api/v1"

    def get(self, path: str, **parameters: Any) -> Any:
        response = httpx.get(f"{self._url}/{path}", params=parameters)
        response.raise_for_status()
        answer = response.json()
        assert answer["status"] == "success", answer
        return answer["data"]

    def until(self, path: str, test: Any, seconds: float = 35.0, **parameters: Any) -> Any:
        """Return the data once they pass a test."""
        end = time.monotonic() + seconds
        while not test(data := self.get(path, **parameters)):
            assert time.monotonic() < end, (path, parameters, data)
            time.sleep(0.3)
        return data


@pytest.fixture(scope="module")
def prometheus(settings: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    """Return a Prometheus that has read a monitor twice."""
    port = free_port()
    with served_run(tmp_path_factory.mktemp("state")) as monitor:
        text = (settings / "prometheus.yml").read_text(encoding="utf-8")
        assert text.count(TARGET) == 1
        (settings / "test.yml").write_text(text.replace(TARGET, f"127.0.0.1:{monitor}"), encoding="utf-8")
        command = ["prometheus", "--config.file=test.yml", "--storage.tsdb.path=data"]
        with server_process([*command, f"--web.listen-address=127.0.0.1:{port}"], settings) as output:
            api, end = Api(port), time.monotonic() + 30.0
            while True:
                try:
                    api.get("status/buildinfo")
                    break
                except httpx.HTTPError:  # no answer yet, or 503: it reads its storage
                    assert time.monotonic() < end, output.read_text()
                    time.sleep(0.1)
            twice = "increase(modalwatch_gaps[1h])"  # needs two values
            api.until("query", lambda data: data["result"], query=twice)
            yield api


def test_promtool_accepts_settings_and_rules(settings: Path) -> None:
    for check, file in (("config", "prometheus.yml"), ("rules", "modalwatch.rules.yml")):
        done = subprocess.run(["promtool", "check", check, file], cwd=settings, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


HEALTHY = {
    'modalwatch_state{instance="m",state="alarm"}': "0x60",
    'modalwatch_device_lost{instance="m",device="left"}': "0x60",
    'modalwatch_status_age_seconds{instance="m"}': "1x60",
    'up{instance="m",job="modalwatch"}': "1x60",
    'modalwatch_window_overdue{instance="m"}': "0x60",
    'modalwatch_left_out_windows{instance="m"}': "2x60",
    'modalwatch_disk_free_bytes{instance="m"}': "1000000000x60",
    'modalwatch_disk_failed{instance="m"}': "0x60",
    'modalwatch_notices_failed{instance="m"}': "0x60",
}


@pytest.mark.parametrize(
    ("series", "values", "alert"),
    [
        (None, "", None),
        ('modalwatch_state{instance="m",state="alarm"}', "0x29 1x30", "ModalwatchAlarm"),
        ('modalwatch_device_lost{instance="m",device="left"}', "0x20 1x39", "ModalwatchDeviceMissing"),
        ('modalwatch_status_age_seconds{instance="m"}', "31x60", "ModalwatchStatusStale"),
        ('up{instance="m",job="modalwatch"}', "1x20 0x39", "ModalwatchStatusStale"),
        ('modalwatch_window_overdue{instance="m"}', "1x60", "ModalwatchAnalysisLagging"),
        ('modalwatch_left_out_windows{instance="m"}', "2x20 3x39", "ModalwatchAnalysisLagging"),
        ('modalwatch_disk_free_bytes{instance="m"}', "700000000x60", "ModalwatchDiskNearlyFull"),
        ('modalwatch_disk_failed{instance="m"}', "1x60", "ModalwatchDiskNearlyFull"),
        ('modalwatch_notices_failed{instance="m"}', "1x60", "ModalwatchNoticeUndelivered"),
    ],
)
def test_each_fault_fires_its_alert_alone(
    settings: Path, tmp_path: Path, series: str | None, values: str, alert: str | None
) -> None:
    """One value per minute; the alerts after half an hour are compared. A site without a fault has none."""
    faults = HEALTHY | ({series: values} if series else {})
    expression = 'ALERTS{alertstate="firing"}'
    labels = f'ALERTS{{alertname="{alert}",alertstate="firing",instance="m"'
    got = {"expr": f"count by (alertname, alertstate, instance) ({expression})", "eval_time": "30m"}
    expected = [{"labels": labels.removeprefix("ALERTS") + "}", "value": 1}] if alert else []
    group = {
        "interval": "1m",
        "input_series": [{"series": name, "values": given} for name, given in faults.items()],
        "promql_expr_test": [got | {"exp_samples": expected}],
    }
    test = {"rule_files": [str(settings / "modalwatch.rules.yml")], "evaluation_interval": "1m", "tests": [group]}
    (tmp_path / "test.yml").write_text(json.dumps(test))  # JSON is YAML
    done = subprocess.run(["promtool", "test", "rules", tmp_path / "test.yml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def values_of(api: Api, query: str) -> str:
    """Return the values of a variable of the dashboard as Grafana puts them into a query."""
    found = re.fullmatch(r"label_values\((.+), (\w+)\)", query.replace("$instance", ".*"))
    assert found is not None, query
    values = api.get(f"label/{found[2]}/values", **{"match[]": found[1]})
    assert values, query
    return "|".join(values)


@pytest.mark.live
@pytest.mark.parametrize("query", QUERIES)
def test_query_of_the_dashboard_has_data(prometheus: Api, query: str) -> None:
    for variable in DASHBOARD["templating"]["list"]:
        query = query.replace(f"${variable['name']}", values_of(prometheus, variable["query"]["query"]))
    assert "$" not in query
    result = prometheus.get("query", query=query)["result"]
    assert result
    assert all(sample["value"][1] != "NaN" for sample in result)


@pytest.mark.live
def test_band_of_a_mode_is_one_standard_deviation_wide(prometheus: Api) -> None:
    [frequency, lower, upper] = (
        float(prometheus.get("query", query=expression)["result"][0]["value"][1])
        for expression in (
            'modalwatch_mode_frequency_hertz{mode="1"}',
            'modalwatch_mode_frequency_hertz{mode="1"} - modalwatch_mode_frequency_std_hertz{mode="1"}',
            'modalwatch_mode_frequency_hertz{mode="1"} + modalwatch_mode_frequency_std_hertz{mode="1"}',
        )
    )
    assert upper - frequency == pytest.approx(frequency - lower)
    assert upper - frequency == pytest.approx(4e-4 * frequency, rel=0.1)  # tests/support/monitor/results.py


@pytest.mark.live
def test_alert_rules_are_evaluated_and_the_alarm_fires(prometheus: Api) -> None:
    def alarm(data: Any) -> bool:
        return [alert["state"] for alert in data["alerts"]] == ["firing"]

    alerts = prometheus.until("alerts", alarm)["alerts"]
    assert alerts[0]["labels"]["alertname"] == "ModalwatchAlarm"
    assert alerts[0]["annotations"]["summary"].endswith("alarm, the structure has changed")
    [group] = prometheus.get("rules")["groups"]
    assert {rule["health"] for rule in group["rules"]} == {"ok"}
    names = set(prometheus.get("label/__name__/values"))
    for rule in group["rules"]:
        prometheus.get("query", query=rule["query"])
        assert set(re.findall(r"\b(?:modalwatch_\w+|up)\b", rule["query"])) <= names, rule["query"]
