"""Texts attached to a log that its analysis depends on, and the keys of its steps."""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import lru_cache

from daq import LogError, read_attachments
from daq.log import log_start
from monitor.archive.catalog import ArchiveLog, LogPiece
from monitor.errors import MonitorError
from monitor.settings import attached_structure, has_settings, parse_attached
from monitor.watch.memory import MEMORY, VERSION
from updater import UpdaterError


@dataclass(frozen=True, kw_only=True)
class LogTexts:
    """Attachments of a log that its analysis depends on."""

    site: str
    structure: str
    memory: str = ""
    start: int = 0  #: time of the first scan [ns UTC]


def texts_of(log: ArchiveLog, site: LogTexts | None) -> LogTexts | str:
    """Return what a log is analysed with, or the reason why it cannot be."""
    try:
        attached, start = read_attachments(log.files[0]), _start(log)
    except LogError as error:
        return str(error)
    memory = attached.get(MEMORY, "")
    if site:
        return replace(site, memory=memory, start=start)
    if not has_settings(attached):
        return "has no settings attached: give --site"
    texts = LogTexts(
        site=attached["site.toml"], structure=attached.get("structure.toml", ""), memory=memory, start=start
    )
    problem = _problem(texts.site, texts.structure)
    return f"has settings that cannot be used: {problem}" if problem else texts


def _start(log: ArchiveLog) -> int:
    """Return the time of the first scan [ns UTC]; 0 if there is none."""
    return next((time for path in log.files if (time := log_start(path)) is not None), 0)


@lru_cache(maxsize=64)
def _problem(site: str, structure: str) -> str | None:
    try:
        parse_attached(site)
        attached_structure(structure)
    except (MonitorError, UpdaterError) as error:
        return str(error)
    return None


def site_name(texts: LogTexts) -> str:
    """Return the name of a site: that of its structure; without one that of its history; usable for a folder."""
    return _site_name(texts.site, texts.structure)


@lru_cache(maxsize=64)
def _site_name(site: str, structure: str) -> str:
    attached = attached_structure(structure)
    name = attached.name if attached else parse_attached(site).history.site or ""
    safe = "".join(letter if letter.isalnum() or letter in " -_." else "_" for letter in name).strip(" .")
    if safe == name:
        return name
    return f"{safe or 'unnamed'}-{hashlib.sha256(name.encode()).hexdigest()[:6]}" if name else "unnamed"  # of a folder


def steps_key(piece: LogPiece, texts: LogTexts) -> str:
    """Return the hash that the steps of a piece depend on: its content, the settings of its analysis, this program."""
    depends = {"version": VERSION, "log": piece.key, **_analysis(texts.site)}
    return hashlib.sha256(json.dumps(depends).encode()).hexdigest()[:32]


@lru_cache(maxsize=64)
def _analysis(site: str) -> dict[str, object]:
    settings = parse_attached(site)
    analysis = settings.analysis
    return {
        "window": [analysis.window_seconds, settings.step_seconds, analysis.band],
        "channels": [[c.name, c.device, c.axis] for c in settings.channels],
        "devices": [[d.name, d.rate] for d in settings.device],
    }
