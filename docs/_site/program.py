"""Reference from the tables of the program: commands, settings, files, topics, metrics, names of Python."""

import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields as fields_of
from functools import cache
from importlib import import_module
from typing import Any

import typer
from pydantic import BaseModel
from sphinx.pycode import ModuleAnalyzer

from daq.drivers import driver_names, low_grade
from daq.events import EventPayload
from docs._site import models
from docs._site.models import heading, table
from monitor.archive.dataset import schemas
from monitor.cli.commands import COMMANDS, command
from monitor.cli.main import app
from monitor.outputs.history.schema import metadata
from monitor.results import service_events, windows
from monitor.results.comparison import DiagnosisAnswer, DiscrepancyResult
from monitor.results.site_status import DeviceStatus, ModeStatus, SiteStatus, WindowStatus
from monitor.rig import Scenario
from monitor.service.servers.web.metrics import metrics
from monitor.settings import Settings
from monitor.settings.reading import section_of
from oma import METHODS
from updater.causes import CATALOGUE
from updater.structure import Structure
from updater.structure.section_shapes import SHAPES


def commands(section: str) -> str:
    """Return the commands of a section of `modalwatch --help`, with arguments, options and example."""
    return "\n\n".join(_command(path) for path, (of, _) in COMMANDS.items() if of == section)


def _command(path: str) -> str:
    made = command(path)
    context = typer.Context(made, info_name=f"modalwatch {path}")
    usage = " ".join((f"modalwatch {path}", *made.collect_usage_pieces(context)))
    text = re.sub(r"(?<!\n)\n(?!\n)", " ", made.help or "")
    parts = [heading(2, path), _code(usage), text]
    parts.append(_options(made, context))
    return "\n\n".join([*parts, "Example:", _code(made.epilog or "")])


def _plain(text: str) -> str:
    """Escape what Markdown would read as markup, except in code."""
    parts = " ".join(text.split()).split("`")
    parts[::2] = [re.sub(r"([*_<>\[\]])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def _code(text: str, language: str = "console") -> str:
    return f"```{language}\n{text}\n```" if language != "console" else f"```text\n{text}\n```"


def global_options() -> str:
    """Return the options before the command."""
    group = typer.main.get_command(app)
    context = typer.Context(group, info_name="modalwatch")
    return _options(group, context)


def _options(made: Any, context: Any) -> str:  # noqa: ANN401 - typer does not export the types
    listed = [record for parameter in made.get_params(context) if (record := parameter.get_help_record(context))]
    rows = ((f"`{_without_type(name)}`", _plain(text)) for name, text in listed if name != "--help")
    return table(("argument or option", "meaning"), rows)


def _without_type(name: str) -> str:
    return re.sub(r" <[^>]+>", "", name)


def settings() -> str:
    """Return the settings of SITE.toml, a section each."""
    parts = []
    plain = [
        row for row in models.rows(Settings) if section_of(Settings.model_fields[row[0].strip("`")].annotation) is None
    ]
    parts += [heading(2, "Top level"), table(_SETTING, (_setting(row) for row in plain))]
    for name, field in Settings.model_fields.items():
        section = section_of(field.annotation)
        if section is not None:
            many = isinstance(field.default, tuple) or field.is_required()
            parts += list(_settings(f"[[{name}]]" if many else f"[{name}]", section))
    return "\n\n".join(parts)


_SETTING = ("key", "default", "type", "meaning")


def _setting(row: tuple[str, str, str, str]) -> tuple[str, str, str, str]:
    return row[0], row[2], models.written(row[1]).replace("SecretStr", "text (may be a secret)"), row[3]


def _settings(head: str, section: type[BaseModel]) -> Iterator[str]:
    inner = {name: below for name, f in section.model_fields.items() if (below := section_of(f.annotation))}
    own = [row for row in models.rows(section) if row[0].strip("`") not in inner]
    yield heading(2, f"`{head}`")
    yield (section.__doc__ or "").strip()
    yield table(_SETTING, (_setting(row) for row in own))
    for name, below in inner.items():
        yield from _settings(f"[{head.strip('[]')}.{name}]", below)


def scenario() -> str:
    """Return the entries of SCENARIO.toml."""
    return models.described([Scenario])


def structure() -> str:
    """Return the entries of structure.toml."""
    return models.described([Structure])


def shapes() -> str:
    """Return the shapes of sections."""
    return table(
        ("`shape`", "section", "dimensions [m]"),
        (
            (f"`{name}`", (s.__doc__ or "").strip(), ", ".join(f"`{f}`" for f in s.model_fields))
            for name, s in SHAPES.items()
        ),
    )


def diagnosis_json() -> str:
    """Return the keys of diagnosis.json."""
    return models.described([DiagnosisAnswer], of_a_file=False)


def discrepancy_json() -> str:
    """Return the keys of discrepancy.json."""
    return models.described([DiscrepancyResult], of_a_file=False)


def status_json() -> str:
    """Return the keys of status.json."""
    return models.described([SiteStatus], of_a_file=False)


_RESULTS = {
    windows.TOPIC_WINDOW: windows.WindowResult,
    windows.TOPIC_REFERENCE: windows.ReferenceResult,
    windows.TOPIC_ALARM: windows.AlarmResult,
    windows.TOPIC_SELF_TEST: windows.SelfTestResult,
}


def results() -> str:
    """Return the messages of results in a log."""
    rows = [
        (f"`{t}`", f"[{m.__name__}](#{m.__name__.lower()})", (m.__doc__ or "").strip()) for t, m in _RESULTS.items()
    ]
    elsewhere: dict[models.Model, str] = {
        DiagnosisAnswer: "../json/diagnosis.md",
        DiscrepancyResult: "../json/discrepancy.md",
    }
    return (
        table(("topic", "message", "content"), rows)
        + "\n\n"
        + models.described(_RESULTS.values(), of_a_file=False, elsewhere=elsewhere)
    )


def events() -> str:
    """Return the events in a log, with their fields."""
    found = sorted((kind for kind in _subclasses(EventPayload) if "topic" in vars(kind)), key=lambda kind: kind.topic)
    rows = ((f"`{k.topic}`", (k.__doc__ or "").strip(), _fields(k)) for k in found)
    return table(("topic", "event", "fields"), rows)


def _subclasses(kind: type[EventPayload]) -> Iterator[type[EventPayload]]:
    assert service_events  # imported: its events are subclasses too
    for below in kind.__subclasses__():
        yield below
        yield from _subclasses(below)


def _fields(kind: type[EventPayload]) -> str:
    meanings = models.comments(kind)
    texts = {e.name: meanings.get(e.name, "") for e in fields_of(kind)}
    return "; ".join(f"`{n.rstrip('_')}`" + (f": {t}" if t else "") for n, t in texts.items())


def parquet() -> str:
    """Return the tables of the results of `reanalyse`."""
    parts = []
    for name, schema in schemas().items():
        parts += [heading(2, f"`{name}`"), table(("column", "type"), ((f"`{f.name}`", f"`{f.type}`") for f in schema))]
    return "\n\n".join(parts)


def history_tables() -> str:
    """Return the tables of the history."""
    parts = []
    for found in metadata.sorted_tables:
        rows = ((f"`{c.name}`", str(c.type).lower(), "yes" if c.primary_key else "") for c in found.columns)
        parts += [heading(2, f"`{found.name}`"), table(("column", "type", "in the key"), rows)]
    return "\n\n".join(parts)


def prometheus() -> str:
    """Return the metrics, from those of a site with one device and one mode."""
    mode = ModeStatus(frequency=1, frequency_std=1, damping=1, damping_std=1)
    novelty = windows.Novelty(t2=1, limit=1, modes=[1])
    test = windows.SelfTestResult(time=0, mass=1, places=1, detected=1, passed=True, last_passed=0)
    status = SiteStatus.model_validate(
        {
            "time": 0,
            "started": 0,
            "pid": 1,
            "state": "normal",
            "step_seconds": 1,
            "window_age": 0,
            "window_overdue": False,
            "window": WindowStatus(index=0, phase="watching", novelty=novelty, n_modes=1, modes={1: mode}),
            "devices": {"one": DeviceStatus(lost=False, silent=0, temperature=0)},
            "temperature": 0,
            "latency": {"window": 0, "alarm": 0},
            "memory_use": {"blocks": 0, "heap_bytes": 0},
            "self_test": test,
            "counters": {"waiting": {"log": 0}, "bad_bytes": {"one": 0}, "thread_failures": {"one": 0}},
        }
    )
    text = metrics(status).decode()
    labels = dict(re.findall(r'^(\w+)\{(\w+)="', text, re.MULTILINE))
    rows = re.findall(r"^# HELP (\w+) (.*)$", text, re.MULTILINE)
    return table(("metric", "label", "meaning"), ((f"`{n}`", labels.get(n, ""), meaning) for n, meaning in rows))


def causes() -> str:
    """Return the names of the causes of a diagnosis."""
    return ", ".join(f"`{name}`" for name in CATALOGUE)


def methods() -> str:
    """Return the methods of identification with their options."""
    rows = ((f"`{n}`", f"`{m.__name__}`", (m.__doc__ or "").strip().split("\n")[0]) for n, m in METHODS.items())
    return table(("name", "class", "method"), rows)


def drivers() -> str:
    """Return the names of the drivers of this package."""
    rows = ((f"`{name}`", low_grade(name) or "") for name in driver_names())
    return table(("driver", "limit of its data"), rows)


DOORS = ("daq", "oma", "updater")  #: packages with names of their own
ROOMS = {
    "daq": ("log", "files", "drivers", "timing", "emulator"),
    "oma": ("methods", "preparation", "selection", "spectral", "tracking"),
    "updater": (
        *("structure", "fe", "modal_data", "reference", "baseline", "validation"),
        *("causes", "inference", "diagnosis", "localization", "one_step", "planning"),
    ),
    "monitor": ("settings", "rig", "archive", "detection"),
}  #: subpackages that pages describe


@cache
def documented_names() -> dict[str, str]:
    """Return the full name of everything that pages describe, by its last part."""
    found = {name: f"{p}.{r}.{name}" for p, rooms_ in ROOMS.items() for r in rooms_ for name in _exported(f"{p}.{r}")}
    return found | {name: f"{package}.{name}" for package in DOORS for name in _exported(package)}


def _exported(module: str) -> list[str]:
    room = vars(import_module(module))
    public = (name for name, value in room.items() if not name.startswith("_") and not inspect.ismodule(value))
    return sorted(room.get("__all__", public))


def front_door(package: str) -> str:
    """Return the names that a package exports, in groups."""
    return _names(package, _exported(package))


def rooms(package: str, *names: str) -> str:
    """Return the names of subpackages that the package itself does not export."""
    assert set(names) <= set(ROOMS[package])
    parts = []
    for room in names:
        module = f"{package}.{room}"
        own = [name for name in _exported(module) if name not in _exported(package)]
        summary = (import_module(module).__doc__ or "").strip().split("\n")[0]
        parts += [heading(2, module), summary, _names(module, own, level=3)]
    return "\n\n".join(parts)


def _is_plain(value: object) -> bool:
    return not (inspect.isclass(value) or inspect.isroutine(value))


_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "Functions": (inspect.isroutine, "autofunction"),
    "Classes": (lambda found: inspect.isclass(found) and not issubclass(found, Exception), "autoclass"),
    "Errors": (lambda found: inspect.isclass(found) and issubclass(found, Exception), "autoexception"),
}


def _names(module: str, names: Iterable[str], level: int = 2) -> str:
    found = {name: getattr(import_module(module), name) for name in names}
    parts = []
    for kind, (is_kind, directive) in _KINDS.items():
        own = sorted((name for name, value in found.items() if is_kind(value)), key=str.lower)
        if own:
            parts += [heading(level, kind), *(_described(directive, f"{module}.{name}", found[name]) for name in own)]
    plain = sorted((name for name, value in found.items() if _is_plain(value)), key=str.lower)
    if plain:
        rows = ((f"`{name}`", _constant(module, name)) for name in plain)
        parts += [heading(level, "Constants and types"), table(("name", "meaning"), rows)]
    return "\n\n".join(parts)


def _described(directive: str, name: str, thing: Any) -> str:  # noqa: ANN401 - whatever a package exports
    if not (inspect.isclass(thing) and issubclass(thing, BaseModel)):
        return f"```{{eval-rst}}\n.. {directive}:: {name}\n```"
    fields = ", ".join(("model_config", "model_post_init", *thing.model_fields))
    described = f"```{{eval-rst}}\n.. {directive}:: {name}\n   :exclude-members: {fields}\n```"
    rows = ((key, models.unlinked(kind), default, meaning) for key, kind, default, meaning in models.rows(thing))
    return f"{described}\n\n{table(('field', 'type', 'default', 'meaning'), rows)}"


def _constant(module: str, name: str) -> str:
    """Return the meaning of a constant, from the comment where it is set; without one, its value."""
    while True:
        analyzer = ModuleAnalyzer.for_module(module)
        documented = analyzer.find_attr_docs().get(("", name))
        if documented:
            return _plain(" ".join(documented))
        origin = re.search(rf"^from (\S+) import (?:[^(\n]*|\([^)]*)\b{name}\b", analyzer.code, re.MULTILINE)
        if origin is None:
            value = getattr(import_module(module), name)
            return f"`{value!r}`" if isinstance(value, str | int | float) else f"`{_short(value)}`"
        renamed = re.search(rf"\b(\w+) as {name}\b", analyzer.code)
        module, name = origin[1], renamed[1] if renamed else name


def _short(value: object) -> str:
    """Return a type or a table in a few words."""
    text = re.sub(r"\b(?:\w+\.)+(\w+)", r"\1", str(value))
    return text if len(text) < 80 else type(value).__name__
