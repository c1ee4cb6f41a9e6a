"""/metrics in the text form that Prometheus reads."""

import time
from typing import Any

from prometheus_client import CollectorRegistry, Gauge, generate_latest

from monitor.service.servers.web.source import TROUBLES, problems

_STATES = ("learning", "normal", "watch", "alarm")


def metrics(vitals: dict[str, Any] | None) -> bytes:
    """Return the figures; of a monitor that never ran, only that it is not well."""
    registry = CollectorRegistry()
    _gauge(registry, "healthy", "1 if nothing is stale or lost", float(not problems(vitals)))
    if vitals is not None:
        _of_monitor(registry, vitals)
        _of_ways(registry, vitals)
        _of_devices(registry, vitals["devices"])
        _of_window(registry, vitals["window"])
        _of_self_test(registry, vitals.get("self_test"))
        gauge = Gauge("modalwatch_state", "1 for the state of the alarm", ["state"], registry=registry)
        for name in _STATES:
            gauge.labels(name).set(name == vitals["state"])
    return generate_latest(registry)


def _of_monitor(registry: CollectorRegistry, vitals: dict[str, Any]) -> None:
    now = time.time()
    _gauge(registry, "start_time_seconds", "Start of the monitor", vitals["started"])
    _gauge(
        registry,
        "vitals_age_seconds",
        "Time since the monitor last wrote its status, in seconds.",
        now - vitals["time"],
    )
    _gauge(
        registry, "window_age_seconds", "Since a window was last analysed", now - vitals["time"] + vitals["window_age"]
    )
    _gauge(registry, "dropped_items", "Items that did not reach the log", vitals["dropped"])
    _gauge(registry, "history_dropped_items", "Items that the history had no room for", vitals["not_in_history"])
    _gauge(registry, "disk_free_bytes", "Where the log is", vitals["disk_free"])
    for name, text in {"blocks": "Of Python's allocator", "heap_bytes": "Of the C library's"}.items():
        if name in vitals["held"]:
            _gauge(registry, f"held_{name}", f"{text}, in use by the monitor's own process", vitals["held"][name])
    _gauge(
        registry,
        "left_out_windows",
        "Windows left out since the start as the analysis had fallen behind.",
        vitals.get("windows_left_out", 0),
    )
    failures = Gauge(
        "modalwatch_thread_failures", "Unforeseen exceptions since the start.", ["thread"], registry=registry
    )
    for name, count in vitals.get("thread_failures", {}).items():
        failures.labels(name).set(count)
    for name in TROUBLES:
        _gauge(registry, f"{name}_failed", f"1 while {name} is in trouble", float(bool(vitals.get(name))))


def _of_ways(registry: CollectorRegistry, vitals: dict[str, Any]) -> None:
    """Add queues, damaged data, and the delay of results."""
    waiting = Gauge("modalwatch_queue_items", "That wait", ["queue"], registry=registry)
    for name, items in vitals["waiting"].items():
        waiting.labels(name).set(items)
    bad = Gauge(
        "modalwatch_bad_bytes",
        "That no frame with a right checksum held",
        ["device"],
        registry=registry,
    )
    for name, count in vitals["bad_bytes"].items():
        bad.labels(name).set(count)
    texts = {"window": "From a window's last sample to its result", "alarm": "From the last sample that raised it"}
    for name, seconds in vitals["late"].items():
        _gauge(registry, f"{name}_latency_seconds", texts[name], seconds)


def _of_devices(registry: CollectorRegistry, devices: dict[str, Any]) -> None:
    rate = Gauge("modalwatch_scan_rate_hertz", "Scans a second of wall time", ["device"], registry=registry)
    scans = Gauge("modalwatch_scans", "Since the start", ["device"], registry=registry)
    gaps = Gauge("modalwatch_gaps", "Since the start", ["device"], registry=registry)
    lost = Gauge("modalwatch_device_lost", "1 while it is", ["device"], registry=registry)
    for name, device in devices.items():
        rate.labels(name).set(device["rate"])
        scans.labels(name).set(device["scans"])
        gaps.labels(name).set(device["gaps"])
        lost.labels(name).set(device["lost"])


def _of_window(registry: CollectorRegistry, window: dict[str, Any]) -> None:
    if not window:
        return
    _gauge(registry, "window_modes", "Modes in the last window", window["n_modes"])
    if window["novelty"] and window["novelty"]["t2"] is not None:
        _gauge(registry, "novelty", "Of the last window", window["novelty"]["t2"])
        _gauge(registry, "novelty_limit", "Of the last window", window["novelty"]["limit"] or float("nan"))
    frequency = Gauge("modalwatch_mode_frequency_hertz", "In the last window", ["mode"], registry=registry)
    if window["phase"] != "learning":
        for mode, value in window["frequencies"].items():
            frequency.labels(mode).set(value)


def _of_self_test(registry: CollectorRegistry, test: dict[str, Any] | None) -> None:
    if test is None:
        return
    now = time.time()
    _gauge(registry, "self_test_detection_ratio", "Of the mass, over places", test["detected"] / test["places"])
    _gauge(registry, "self_test_mass_kilograms", "That was put into copies of windows", test["mass"])
    _gauge(registry, "self_test_age_seconds", "Since the last one", now - test["time"] * 1e-9)
    if test["last_passed"] is not None:
        _gauge(registry, "self_test_success_age_seconds", "Since one has passed", now - test["last_passed"] * 1e-9)


def _gauge(registry: CollectorRegistry, name: str, text: str, value: float) -> None:
    Gauge(f"modalwatch_{name}", text, registry=registry).set(value)
