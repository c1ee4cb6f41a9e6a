"""Texts attached to a log that its analysis depends on, and the keys of its steps."""

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

from daq import LogError, read_attachments
from daq.log import log_start, read_part
from monitor.archive.catalog import ArchiveLog, LogPiece
from monitor.errors import MonitorError
from monitor.settings import attached_structure, has_settings, parse_attached
from monitor.watch.memory import MEMORY, VERSION
from updater import UpdaterError


@dataclass(frozen=True, kw_only=True)
class LogTexts:
    """Attachments of a log that its analysis depends on, and what identifies its run."""

    site: str
    structure: str
    memory: str = ""
    start: int = 0  #: time of the first scan [ns UTC]
    run: str = ""  #: hash of what identifies the run in all of its files; empty if the file is not one of a run


def texts_of(log: ArchiveLog, site: LogTexts | None) -> LogTexts | str:
    """Return what a log is analysed with, or the reason why it cannot be."""
    try:
        attached, start, run = read_attachments(log.files[0]), _start(log), _run(log)
    except LogError as error:
        return str(error)
    memory = attached.get(MEMORY, "")
    if site:
        return replace(site, memory=memory, start=start, run=run)
    if not has_settings(attached):
        return "has no settings attached: give --site"
    texts = LogTexts(
        site=attached["site.toml"],
        structure=attached.get("structure.toml", ""),
        memory=memory,
        start=start,
        run=run,
    )
    problem = _problem(texts.site, texts.structure)
    return f"has settings that cannot be used: {problem}" if problem else texts


def _start(log: ArchiveLog) -> int:
    """Return the time of the first scan [ns UTC]; 0 if there is none."""
    return next((time for path in log.files if (time := log_start(path)) is not None), 0)


def _run(log: ArchiveLog) -> str:
    part = read_part(log.files[0])
    return hashlib.sha256(part.run.encode()).hexdigest()[:16] if part else ""


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
    """Return what the steps of a piece depend on: run, content, and a hash of the settings and of this program."""
    depends = {"version": VERSION, **_analysis(texts.site)}
    return f"{texts.run or 'single'}-{piece.key}-{hashlib.sha256(json.dumps(depends).encode()).hexdigest()[:16]}"


def is_obsolete(key: str, present: Mapping[str, Collection[str]]) -> bool:
    """Return whether a key of steps, with any settings, is that of a piece that its run no longer has.

    Parameters
    ----------
    key : as `steps_key` makes it
    present : run -> keys of its pieces; of other runs nothing is known
    """
    run, _, rest = key.partition("-")
    return run in present and rest.partition("-")[0] not in present[run]


@lru_cache(maxsize=64)
def _analysis(site: str) -> dict[str, object]:
    settings = parse_attached(site)
    analysis = settings.analysis
    return {
        "window": [analysis.window_seconds, settings.step_seconds, analysis.band],
        "channels": [[c.name, c.device, c.axis] for c in settings.channels],
        "devices": [[d.name, d.rate] for d in settings.device],
    }
