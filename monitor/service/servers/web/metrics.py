"""Metrics in the text format of Prometheus, for `/metrics`."""

import math
import time
from collections.abc import Mapping

from prometheus_client import CollectorRegistry, Gauge, generate_latest

from monitor.results.site_status import DeviceStatus, PartProblems, SiteStatus, WindowStatus
from monitor.results.windows import SelfTestResult
from monitor.service.servers.web.source import problems

_MEMORY = {
    "blocks": ("python_allocated_blocks", "Blocks of Python's allocator in use by the monitor process."),
    "heap_bytes": ("heap_used_bytes", "Bytes of the C library's heap in use by the monitor process."),
}
_DEVICE = {
    "rate": ("scan_rate_hertz", "Scans received per second of wall time."),
    "scans": ("scans", "Scans received since the start."),
    "gaps": ("gaps", "Gaps in the scans since the start."),
    "lost": ("device_lost", "1 while the device is lost, else 0."),
    "temperature": (
        "device_temperature_celsius",
        "Last reading of the thermometer of the device, in degrees Celsius.",
    ),
}
_STATES = ("learning", "normal", "watch", "alarm")
_MODE = {
    "frequency": ("frequency_hertz", "Frequency of a mode in the last window, in hertz."),
    "frequency_std": ("frequency_std_hertz", "Standard deviation of the frequency of a mode, in hertz."),
    "damping": ("damping_ratio", "Damping of a mode in the last window, as a ratio of the critical damping."),
    "damping_std": ("damping_std_ratio", "Standard deviation of the damping of a mode, as a ratio."),
}


def metrics(status: SiteStatus | None) -> bytes:
    """Return the metrics; without a status file, only that the monitor is not healthy."""
    registry = CollectorRegistry()
    _gauge(registry, "healthy", "1 if the monitor is healthy, else 0.", float(not problems(status)))
    if status is not None:
        _of_monitor(registry, status)
        _of_queues(registry, status)
        _of_devices(registry, status.devices)
        _of_window(registry, status.window)
        _of_self_test(registry, status.self_test)
        states = {name: name == status.state for name in _STATES}
        _gauges(registry, "state", "1 for the present state of the alarm, 0 for the others.", "state", states)
    return generate_latest(registry)


def _of_monitor(registry: CollectorRegistry, status: SiteStatus) -> None:
    now = time.time()
    _gauge(registry, "start_time_seconds", "Start of the monitor, in seconds since 1970.", status.started)
    _gauge(
        registry,
        "status_age_seconds",
        "Time since the monitor last wrote its status, in seconds.",
        now - status.time,
    )
    _gauge(
        registry,
        "window_age_seconds",
        "Time since a window was last analysed, in seconds.",
        now - status.time + status.window_age,
    )
    _gauge(
        registry,
        "window_overdue",
        "1 while no window was analysed for its length and two steps, else 0.",
        float(status.window_overdue),
    )
    if status.temperature is not None:
        text = "Last reading of the thermometer of the site, in degrees Celsius."
        _gauge(registry, "temperature_celsius", text, status.temperature)
    counters = status.counters
    _gauge(registry, "dropped_items", "Items dropped because the queue of the log was full.", counters.dropped)
    text = "Items that the history did not store or spool."
    _gauge(registry, "history_dropped_items", text, counters.history_dropped)
    _gauge(registry, "disk_free_bytes", "Free space of the disk of the log, in bytes.", counters.disk_free)
    for key, (name, text) in _MEMORY.items():
        if key in status.memory_use:
            _gauge(registry, name, text, status.memory_use[key])
    _gauge(
        registry,
        "left_out_windows",
        "Windows left out since the start because the analysis was behind.",
        status.windows_left_out,
    )
    failures = counters.thread_failures
    _gauges(registry, "thread_failures", "Unforeseen exceptions since the start.", "thread", failures)
    for name in PartProblems.model_fields:
        failed = float(name in status.problems.found)
        _gauge(registry, f"{name}_failed", f"1 while the part {name} has a problem, else 0.", failed)


def _of_queues(registry: CollectorRegistry, status: SiteStatus) -> None:
    """Add queues, damaged data, and the delay of results."""
    counters = status.counters
    _gauges(registry, "queue_items", "Items that wait in a queue.", "queue", counters.waiting)
    text = "Bytes since the start outside frames with a valid checksum."
    _gauges(registry, "bad_bytes", text, "device", counters.bad_bytes)
    texts = {
        "window": "Time from the last sample of a window to its result, in seconds.",
        "alarm": "Time from the last sample of a window to the alarm that it raised, in seconds.",
    }
    for name, seconds in status.latency.items():
        _gauge(registry, f"{name}_latency_seconds", texts[name], seconds)


def _of_devices(registry: CollectorRegistry, devices: dict[str, DeviceStatus]) -> None:
    for field, (name, text) in _DEVICE.items():
        _gauges(registry, name, text, "device", {key: getattr(device, field) for key, device in devices.items()})


def _of_window(registry: CollectorRegistry, window: WindowStatus | None) -> None:
    if window is None:
        return
    _gauge(registry, "window_modes", "Number of modes in the last window.", window.n_modes)
    if window.novelty and math.isfinite(window.novelty.t2):
        _gauge(registry, "novelty", "Novelty of the last window.", window.novelty.t2)
        _gauge(registry, "novelty_limit", "Limit of the novelty of the last window.", window.novelty.limit)
    for field, (name, text) in _MODE.items():
        values = {str(identity): getattr(mode, field) for identity, mode in window.tracked.items()}
        _gauges(registry, f"mode_{name}", text, "mode", values)


def _of_self_test(registry: CollectorRegistry, test: SelfTestResult | None) -> None:
    if test is None:
        return
    now = time.time()
    _gauge(
        registry,
        "self_test_detection_ratio",
        "Share of places at which the simulated mass was detected by the last self-test.",
        test.probability,
    )
    _gauge(registry, "self_test_mass_kilograms", "Simulated mass of the last self-test, in kilograms.", test.mass)
    _gauge(registry, "self_test_age_seconds", "Time since the last self-test, in seconds.", now - test.time * 1e-9)
    if test.last_passed is not None:
        _gauge(
            registry,
            "self_test_success_age_seconds",
            "Time since the last self-test that has passed, in seconds.",
            now - test.last_passed * 1e-9,
        )


def _gauge(registry: CollectorRegistry, name: str, text: str, value: float) -> None:
    Gauge(f"modalwatch_{name}", text, registry=registry).set(value)


def _gauges(registry: CollectorRegistry, name: str, text: str, label: str, values: Mapping[str, float | None]) -> None:
    """Add a gauge with a value for each label; values that are absent or not finite are left out."""
    gauge = Gauge(f"modalwatch_{name}", text, [label], registry=registry)
    for key, value in values.items():
        if value is not None and math.isfinite(value):
            gauge.labels(key).set(value)
