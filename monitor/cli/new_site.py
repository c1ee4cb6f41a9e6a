"""A site for a file of measurements: its channels as devices, which `replay` watches and `run` plays."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daq import Recording
from monitor.errors import ArgumentError
from monitor.settings import AXES, DeviceSettings, Settings, annotated

_NAME = "logger"


@contextmanager
def new_site(path: Path, structure: Path, log: Path, recording: Recording) -> Iterator[None]:
    """Write a site with the channels of a recording, every setting with what it means; if what follows fails, none.

    Parameters
    ----------
    path : of the site, which must not be there yet
    structure : its structure file
    log : that will hold the recording

    Raises
    ------
    ArgumentError
        If there is such a file, or it cannot be written.
    """
    settings = Settings(structure=_from(path, structure), device=tuple(_devices(path, log, recording)))
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(annotated(settings))
    except FileExistsError as error:
        raise ArgumentError("--new-site", f"{path} is there already: give it as --site") from error
    except OSError as error:
        raise ArgumentError("--new-site", f"{path}: cannot be written: {error.strerror}") from error
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _devices(path: Path, log: Path, recording: Recording) -> Iterator[DeviceSettings]:
    """Yield devices of up to three channels; what lacks other samples is on another device."""
    together: dict[str, list[str]] = {}
    for channel in recording.channels:
        together.setdefault(channel.device, []).append(channel.name)
    threes = [own[k : k + len(AXES)] for own in together.values() for k in range(0, len(own), len(AXES))]
    for number, names in enumerate(threes, 1):
        name = f"{_NAME}-{number}"
        yield DeviceSettings.model_validate(
            {
                "name": name,
                "driver": "replay",
                "log": {"file": _from(path, log), "device": name},
                "rate": recording.rate,
                "channels": dict(zip(AXES, names, strict=False)),
            }
        )


def _from(site: Path, file: Path) -> str:
    """Return a path as the site's file says it."""
    return Path(os.path.relpath(file.resolve(), site.resolve().parent)).as_posix()


def learning_notes(settings: Settings, seconds: float, site: Path) -> Iterator[str]:
    """Say if a record [s] is too short to learn from."""
    if seconds >= settings.learning_seconds:
        return
    analysis = settings.analysis
    yield (
        f"by {site} a watch learns for {settings.learning_seconds:g} s ({analysis.baseline_windows} windows of "
        f"{analysis.window_seconds:g} s), the log has {seconds:.6g} s: mind window_seconds and baseline_windows there"
    )
