"""Watch of a series of modes that another program has identified."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from daq import Event, LogError, McapWriter
from monitor.analysis.modal_table.series import ModalSeries
from monitor.analysis.temperature import reading
from monitor.results.service_events import Stopped
from monitor.results.windows import Result, result_event
from monitor.service.site import load_site
from monitor.settings import (
    AXES,
    AnalysisSettings,
    DeviceSettings,
    Settings,
    annotated,
    attachable,
    attached_structure,
    overridden,
    overrides,
    parse_settings,
)
from monitor.watch.pipeline import Pipeline
from updater.structure import no_sensor_text

_DEVICE = "series"
_SECONDS = (1.0, 1e6)  # least and most from one row to the next


class SynchronousSettings(Settings):
    """Settings of a series: the shapes of another program have no delays of devices."""

    @property
    def device_of(self) -> dict[str, str]:
        """One device for all channels."""
        return dict.fromkeys((channel.name for channel in self.channels), _DEVICE)


@dataclass(frozen=True, kw_only=True)
class SeriesSite:
    """Site of a series: the columns of its shapes are the channels, the usual time between rows is the window."""

    settings: SynchronousSettings
    site_text: str
    structure_text: str  #: empty for none


def series_site(series: ModalSeries, site: Path | None, given: Sequence[str]) -> SeriesSite:
    """Return the settings by which a series is watched.

    Parameters
    ----------
    series : its channels are the devices
    site : SITE.toml whose structure, `[alarm]` and lengths of the baseline are used; None for the defaults
    given : KEY=VALUE each, which override the settings

    Raises
    ------
    LogError
        If the time between rows is no length of a window, or the shapes are not at sensors of the structure.
    """
    if not _SECONDS[0] <= series.step <= _SECONDS[1]:
        found = f"{series.step:g} s"
        raise LogError(series.path, f"expected {_SECONDS[0]:g} to {_SECONDS[1]:g} s from row to row, found {found}")
    loaded = load_site(site, given) if site else None
    structure_text = loaded.structure_text if loaded else ""
    _check_channels(series, structure_text)
    base = loaded.settings if loaded else Settings(device=tuple(_devices(series)))
    analysis = base.analysis.model_dump() | {"window_seconds": series.step, "overlap": 0.0, "band": None}
    sensors = tuple(sensor for sensor in base.sensor if sensor.channel in series.channels)
    own = {
        "device": tuple(_devices(series)),
        "sensor": sensors,
        "lines": base.lines if len(sensors) == len(base.sensor) else (),
        "analysis": AnalysisSettings.model_validate(analysis),
        "temperature": None,
    }
    text, origins = overridden(annotated(base.model_copy(update=own)), overrides(given, {}))
    text = attachable(text)
    settings = SynchronousSettings.model_construct(**dict(parse_settings(text, site or series.path, origins)))
    return SeriesSite(settings=settings, site_text=text, structure_text=structure_text)


def _check_channels(series: ModalSeries, structure_text: str) -> None:
    """Refuse a series whose shapes cannot be compared with the modes of the structure."""
    structure = attached_structure(structure_text)
    known = structure.channels if structure else series.channels
    strange = [channel for channel in series.channels if channel not in known]
    if strange and not series.has_shapes:
        raise LogError(series.path, "has no shapes, by which modes are paired with the model: use a site without one")
    if strange:
        raise LogError(series.path, f"shape: {no_sensor_text(strange[0], known, 'the structure')}")


def _devices(series: ModalSeries) -> list[DeviceSettings]:
    """Return devices of up to three channels."""
    threes = [series.channels[k : k + len(AXES)] for k in range(0, len(series.channels), len(AXES))]
    return [
        DeviceSettings.model_validate(
            {
                "name": f"series-{number}",
                "driver": "replay",
                "log": {"file": series.path.name, "device": f"series-{number}"},
                "channels": dict(zip(AXES, names, strict=False)),
            }
        )
        for number, names in enumerate(threes, 1)
    ]


def watch_series(series: ModalSeries, site: SeriesSite, on_result: Callable[[Result], None]) -> list[Result]:
    """Learn from the first windows of a series, and judge the others."""
    pipeline, found = Pipeline(attached_structure(site.structure_text), site.settings), list[Result]()
    for window in series.windows(_DEVICE):
        for result in pipeline.push_identified(window):
            found.append(result)
            on_result(result)
    return found


def write_series(path: Path, series: ModalSeries, site: SeriesSite, results: Sequence[Result]) -> None:
    """Write a log with the results and the temperatures, for `report` and `view`; it has no signals.

    Raises
    ------
    LogError
        If the file exists or cannot be made.
    """
    texts = {"site.toml": site.site_text, "structure.toml": site.structure_text}
    writer = McapWriter(path, {name: text for name, text in texts.items() if text})
    items: list[Event] = [result_event(result) for result in results]
    known = zip(series.time, series.temperature, strict=True)
    items += [reading(round(1e9 * time), celsius, series.path.name) for time, celsius in known if celsius == celsius]
    items.sort(key=lambda item: item.time)
    for item in [*items, Stopped().event(items[-1].time)]:
        writer.write(item)
    writer.close()
