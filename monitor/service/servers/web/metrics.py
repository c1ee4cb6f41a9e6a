"""Metrics in the text format of Prometheus, for `/metrics`."""

import math
import time

from prometheus_client import CollectorRegistry, Gauge, generate_latest

from monitor.results.site_status import DeviceStatus, PartProblems, SiteStatus, WindowStatus
from monitor.results.windows import SelfTestResult
from monitor.service.servers.web.source import problems

_MEMORY = {
    "blocks": ("python_allocated_blocks", "Blocks of Python's allocator in use by the monitor process."),
    "heap_bytes": ("heap_used_bytes", "Bytes of the C library's heap in use by the monitor process."),
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
        gauge = Gauge(
            "modalwatch_state", "1 for the present state of the alarm, 0 for the others.", ["state"], registry=registry
        )
        for name in _STATES:
            gauge.labels(name).set(name == status.state)
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
    failures = Gauge(
        "modalwatch_thread_failures", "Unforeseen exceptions since the start.", ["thread"], registry=registry
    )
    for name, count in status.counters.thread_failures.items():
        failures.labels(name).set(count)
    for name in PartProblems.model_fields:
        failed = float(name in status.problems.found)
        _gauge(registry, f"{name}_failed", f"1 while the part {name} has a problem, else 0.", failed)


def _of_queues(registry: CollectorRegistry, status: SiteStatus) -> None:
    """Add queues, damaged data, and the delay of results."""
    waiting = Gauge("modalwatch_queue_items", "Items that wait in a queue.", ["queue"], registry=registry)
    for name, items in status.counters.waiting.items():
        waiting.labels(name).set(items)
    bad = Gauge(
        "modalwatch_bad_bytes",
        "Bytes since the start outside frames with a valid checksum.",
        ["device"],
        registry=registry,
    )
    for name, count in status.counters.bad_bytes.items():
        bad.labels(name).set(count)
    texts = {
        "window": "Time from the last sample of a window to its result, in seconds.",
        "alarm": "Time from the last sample of a window to the alarm that it raised, in seconds.",
    }
    for name, seconds in status.latency.items():
        _gauge(registry, f"{name}_latency_seconds", texts[name], seconds)


def _of_devices(registry: CollectorRegistry, devices: dict[str, DeviceStatus]) -> None:
    rate = Gauge("modalwatch_scan_rate_hertz", "Scans received per second of wall time.", ["device"], registry=registry)
    scans = Gauge("modalwatch_scans", "Scans received since the start.", ["device"], registry=registry)
    gaps = Gauge("modalwatch_gaps", "Gaps in the scans since the start.", ["device"], registry=registry)
    lost = Gauge("modalwatch_device_lost", "1 while the device is lost, else 0.", ["device"], registry=registry)
    temperature = Gauge(
        "modalwatch_device_temperature_celsius",
        "Last reading of the thermometer of the device, in degrees Celsius.",
        ["device"],
        registry=registry,
    )
    for name, device in devices.items():
        if device.temperature is not None:
            temperature.labels(name).set(device.temperature)
        rate.labels(name).set(device.rate)
        scans.labels(name).set(device.scans)
        gaps.labels(name).set(device.gaps)
        lost.labels(name).set(device.lost)


def _of_window(registry: CollectorRegistry, window: WindowStatus | None) -> None:
    if window is None:
        return
    _gauge(registry, "window_modes", "Number of modes in the last window.", window.n_modes)
    if window.novelty and math.isfinite(window.novelty.t2):
        _gauge(registry, "novelty", "Novelty of the last window.", window.novelty.t2)
        _gauge(registry, "novelty_limit", "Limit of the novelty of the last window.", window.novelty.limit)
    for field, (name, text) in _MODE.items():
        gauge = Gauge(f"modalwatch_mode_{name}", text, ["mode"], registry=registry)
        for identity, mode in window.tracked.items():
            if math.isfinite(value := getattr(mode, field)):
                gauge.labels(identity).set(value)


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
