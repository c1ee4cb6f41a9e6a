"""Site: settings and the texts they come from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING

from daq import driver_names, make_driver
from daq.bounded_text import meant
from monitor.errors import SettingsError
from monitor.settings import Settings, attachable, overrides, read_settings
from monitor.settings.redaction import revealed
from updater import load_structure
from updater.structure import no_sensor_text, portable_text

if TYPE_CHECKING:
    from monitor.outputs.history import Writer
    from monitor.service.servers.web import Source


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """Settings with the texts that are attached to every log; the site's is without secrets and comments."""

    path: Path
    settings: Settings
    site_text: str
    structure_text: str  #: empty for a site without a structure file

    @property
    def folder(self) -> Path:
        """Folder that relative paths in the settings start from."""
        return self.path.parent

    @property
    def name(self) -> str:
        """Name in notices: file name of the structure file; without one, name in the history or of the folder."""
        if self.settings.structure is not None:
            return Path(self.settings.structure).stem
        return self.settings.history.site or self.path.absolute().parent.name or self.path.stem

    @property
    def attachments(self) -> dict[str, str]:
        """Texts that are attached to every log, by name."""
        structure = {"structure.toml": self.structure_text} if self.structure_text else {}
        return {"site.toml": self.site_text, **structure}

    @property
    def source(self) -> "Source":
        """Path of its state for other programs."""
        from monitor.outputs.history import database_url  # loads sqlalchemy, which a replay does not need
        from monitor.service.servers.web import Source

        url = database_url(self.settings.history.url, self.state)
        return Source(name=self.name, state=self.state, url=url, history_site=self.writer.site)

    @property
    def writer(self) -> "Writer":
        """Site of its rows in the history. A SQLite file has one, so that its structure file may be renamed."""
        from monitor.outputs.history import Writer

        history = self.settings.history
        if revealed(history.url).partition(":")[0] in ("", "sqlite"):
            return Writer(site=history.site or "")
        return Writer(site=history.site or self.name, place=f"{gethostname()}:{self.state.absolute()}")

    @property
    def state(self) -> Path:
        """Folder for data that outlive a run."""
        return self.folder / self.settings.state


def load_site(path: Path, given: Sequence[str] = ()) -> Site:
    """Read SITE.toml and its structure, if it has one.

    Parameters
    ----------
    path : of the file
    given : KEY=VALUE each, which override the file and the environment

    Raises
    ------
    ArgumentError, SettingsError, StructureError, DbcError
        Naming file and key; also if a channel is not a sensor of the structure, or a device has no such driver, place
        or rate.
    """
    text, settings = read_settings(path, overrides(given))
    for device in settings.device:
        try:
            make_driver(device.driver, device.place, device.rate)
        except ValueError as error:
            near = "" if device.driver in driver_names() else meant(device.driver, driver_names())
            raise SettingsError(path, f"device {device.name!r}: {error}{near}") from error
    return Site(
        path=path,
        settings=settings,
        site_text=attachable(text),
        structure_text="" if settings.structure is None else _structure_text(path, settings, settings.structure),
    )


def _structure_text(path: Path, settings: Settings, name: str) -> str:
    """Return the text of the structure file, once all channels are sensors of it."""
    structure_path = path.parent / name
    known = load_structure(structure_path).channels
    for channel in settings.channels:
        if channel.name not in known:
            raise SettingsError(path, f"channel {no_sensor_text(channel.name, known, structure_path)}")
    return portable_text(structure_path)
