"""Status of a running monitor, as it is written to `status.json` and read by the web server and the commands."""

from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from daq.bounded_text import parse_json
from monitor.detection.alarm import State
from monitor.results.residuals import ChannelResiduals
from monitor.results.windows import (
    DetectableChange,
    LearningProgress,
    Novelty,
    Number,
    Phase,
    SelfTestResult,
    TrendResult,
)

FILE_NAME = "status.json"  #: in the state folder


class _Status(BaseModel):
    """Base: keys of other versions are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", ser_json_inf_nan="null")


class DeviceStatus(_Status):
    """One device since the start."""

    scans: int = 0
    gaps: int = 0
    lost: bool
    silent: float | None  #: time since the last block; None if there was none [s]
    rate: float = 0.0  #: scans per second of wall time [Hz]
    temperature: float | None = None  #: last reading; None if it has no thermometer [degC]


class ModeStatus(_Status):
    """One mode of the last window."""

    frequency: float  #: [Hz]
    frequency_std: Number  #: [Hz]
    damping: Number  #: [-]
    damping_std: Number  #: [-]


class WindowStatus(_Status):
    """The last window."""

    index: int
    phase: Phase
    problem: str | None = None  #: why it has no modes
    novelty: Novelty | None = None
    end: int | None = None  #: [ns UTC]
    n_modes: int = 0
    modes: dict[int, ModeStatus] = {}  #: by identity

    @property
    def tracked(self) -> dict[int, ModeStatus]:
        """Modes with lasting identities; there are none before the baseline is learned."""
        return {} if self.phase == "learning" else self.modes


class PartProblems(_Status):
    """Problem of each part of the monitor, None while it works."""

    disk: str | None = None
    history: str | None = None
    notices: str | None = None
    home_assistant: str | None = None
    memory: str | None = None
    viewer: str | None = None
    web: str | None = None
    analysis: str | None = None
    temperature: str | None = None
    threads: str | None = None

    @property
    def found(self) -> dict[str, str]:
        """Problems by part; without that of the web server, which then reports nothing."""
        return {name: text for name, text in self if text and name != "web"}


class Counters(_Status):
    """Numbers of the monitor's queues, files and threads since the start."""

    dropped: int = 0  #: items for which the queue of the log had no room
    history_dropped: int = 0  #: items that the history did not store or spool
    disk_free: int = 0  #: free space of the disk of the log [bytes]
    waiting: dict[str, int] = {}  #: items in each queue
    bad_bytes: dict[str, int] = {}  #: bytes outside valid frames, by device
    thread_failures: dict[str, int] = {}  #: unforeseen exceptions, by thread


class SiteStatus(_Status):
    """Status of a monitor; ages are those at the time of writing."""

    time: float  #: time of writing [s since 1970]
    started: float  #: start of the monitor [s since 1970]
    pid: int
    memory_use: dict[str, int] = {}  #: memory of the process
    state: State | Literal["learning"]
    learning: LearningProgress | None = None  #: progress of the baseline, from its first usable window on
    step_seconds: float  #: interval of windows in wall time [s]
    window_age: float  #: time since the last window [s]
    window_overdue: bool
    window: WindowStatus | None = None
    trend: TrendResult | None = None  #: trend at the last evaluated window
    detectable: DetectableChange | None = None  #: smallest changes detectable in the last evaluated window
    blind: str | None = None  #: report of successive windows without a usable result
    missing_channels: list[str] = []  #: reports of channels without data
    overload: str | None = None  #: report of windows that were left out
    windows_left_out: int = 0  #: number since the start
    temperature: float | None = None  #: last reading of the site's thermometer; None if it has none [degC]
    latency: dict[str, float] = {}  #: from the last sample to the result or alarm [s of wall time]
    residuals: ChannelResiduals | None = None  #: residuals of the last block of signals; None before they are learned
    residual_course: list[float] = []  #: largest deviation of each of the last blocks [-]
    self_test: SelfTestResult | None = None  #: last self-test with the present baseline
    identities: dict[str, dict[str, Any]] = {}  #: identities of the devices, kept over restarts
    devices: dict[str, DeviceStatus] = {}
    problems: PartProblems = PartProblems()
    counters: Counters = Counters()

    @property
    def learning_left(self) -> float | None:
        """Wall time until the baseline is learned if all windows are usable and they suffice [s]; None if unknown."""
        if self.learning is None:
            return None
        windows = self.learning.target - self.learning.windows
        return max(0.0, windows * self.step_seconds - self.window_age) if windows > 0 else 0.0


def read_status(path: Path) -> SiteStatus | None:
    """Return the content of a status file; None where none can be read, or it is of another version."""
    try:
        return SiteStatus.model_validate(parse_json(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return None
