"""Tables of the fields of pydantic models and dataclasses: key, type, default and meaning."""

import dataclasses
import enum
import inspect
import re
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.pycode import ModuleAnalyzer

Model = type[Any]
_LIMITS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
_PLAIN = {
    bool: "true or false",
    int: "integer",
    float: "number",
    str: "text",
    Path: "path",
    Any: "any value",
    type(None): "null",
}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def heading(level: int, text: str) -> str:
    """Return a heading."""
    return "#" * level + f" {text}"


def anchor(text: str) -> str:
    """Return the anchor of a heading, as MyST makes it."""
    return re.sub(r"[^\w\- ]", "", text.lower()).strip().replace(" ", "-")


def models_in(annotation: Any) -> Iterator[Model]:  # noqa: ANN401 - any annotation of a field
    """Yield the models in an annotation."""
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or dataclasses.is_dataclass(annotation)):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from models_in(part)


def type_text(annotation: Any, limits: Sequence[Any] = ()) -> str:  # noqa: ANN401 - any annotation of a field
    """Return a type in words, models as links to their own table."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_text(parts[0], (*parts[1:], *limits))
    if origin is Literal:
        return ", ".join(f"`{part}`" for part in parts)
    if origin in (Union, types.UnionType):
        return " or ".join(type_text(part, limits if part is not type(None) else ()) for part in parts)
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return ", ".join(f"`{part.value}`" for part in annotation)
    if any(True for _ in models_in(annotation)) and isinstance(annotation, type):
        return f"[{annotation.__name__}](#{anchor(annotation.__name__)})"
    if origin in (tuple, list) or annotation in (tuple, list):
        return _sequence(origin, parts)
    if origin and issubclass(origin, Mapping):
        return f"table: {type_text(parts[0])} to {type_text(parts[1])}"
    plain = _PLAIN.get(annotation, getattr(annotation, "__name__", "any value"))
    return f"{plain}{_limits(limits)}"


def _sequence(origin: Any, parts: tuple[Any, ...]) -> str:  # noqa: ANN401 - tuple or list
    if origin is tuple and Ellipsis not in parts:
        same = len(set(parts)) == 1
        return f"[{len(parts)} x {type_text(parts[0])}]" if same else f"[{', '.join(map(type_text, parts))}]"
    return f"list of {type_text(parts[0])}" if parts else "list"


def _limits(limits: Sequence[Any]) -> str:
    """Return the bounds of a number."""
    flat = [part for limit in limits for part in (limit.metadata if isinstance(limit, FieldInfo) else (limit,))]
    found = {n: getattr(limit, n) for limit in flat for n in _LIMITS if getattr(limit, n, None) is not None}
    return "".join(f", {_LIMITS[name]} {value:g}" for name, value in found.items())


def comments(model: Model) -> dict[str, str]:
    """Return the meaning of each field, from the `#:` comment at it."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if base.__module__ not in ("builtins", "abc", "enum", "typing") and not base.__module__.startswith("pydantic"):
            documented = ModuleAnalyzer.for_module(base.__module__).find_attr_docs()
            found |= {
                name: " ".join(text).strip() for (of, name), text in documented.items() if of == base.__qualname__
            }
    return found


def rows(model: Model) -> Iterator[tuple[str, str, str, str]]:
    """Yield key, type, default and meaning of each field."""
    meanings = comments(model)
    if issubclass(model, BaseModel):
        for name, field in model.model_fields.items():
            default = "required" if field.is_required() else default_text(_default(field))
            meaning = field.description or meanings.get(name, "") or _summary(field.annotation)
            yield f"`{field.alias or name}`", type_text(field.annotation, field.metadata), default, meaning
    else:
        hints = {name: kind for base in reversed(model.__mro__) for name, kind in _hints(base).items()}
        for entry in dataclasses.fields(model):
            missing = entry.default is dataclasses.MISSING
            default = "required" if missing else default_text(entry.default)
            yield f"`{entry.name.rstrip('_')}`", type_text(hints[entry.name]), default, meanings.get(entry.name, "")


def _hints(base: type) -> dict[str, Any]:
    return {name: kind for name, kind in vars(base).get("__annotations__", {}).items() if not isinstance(kind, str)}


def _summary(annotation: Any) -> str:  # noqa: ANN401 - any annotation of a field
    """Return the first line of the docstring of a model, for a field without a meaning of its own."""
    return next(((inspect.getdoc(model) or "").partition("\n")[0] for model in models_in(annotation)), "")


def _default(field: FieldInfo) -> object:
    return field.get_default(call_default_factory=True, validated_data={})


def default_text(value: object) -> str:
    """Return a default as it is written in a file."""
    if value is None:
        return "none"
    if isinstance(value, BaseModel):
        return "its defaults"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple | list | dict) and not value:
        return "empty"
    if isinstance(value, tuple | list) and len(value) > 3 and len(set(value)) == 1:
        return f"{len(value)} x {default_text(value[0])}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(default_text, value)) + "]"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def described(
    first: Iterable[Model], level: int = 2, *, of_a_file: bool = True, elsewhere: Mapping[Model, str] | None = None
) -> str:
    """Return a section for each model and for those in its fields, each once.

    Those of a file that people write have defaults, and no null. Models with a page elsewhere are linked to it.
    """
    elsewhere = elsewhere or {}
    waiting, done, sections = list(first), set(elsewhere), []
    while waiting:
        model = waiting.pop(0)
        if model in done:
            continue
        done.add(model)
        text = inspect.getdoc(model) or ""
        if text.startswith(f"{model.__name__}("):  # made by dataclass
            text = ""
        found = [
            (key, written(kind), default, meaning) if of_a_file else (key, kind, in_json(meaning))
            for key, kind, default, meaning in rows(model)
        ]
        head = ("key", "type", "default", "meaning") if of_a_file else ("key", "type", "meaning")
        text = text if of_a_file else in_json(text)
        sections += [heading(level, model.__name__), text, table(head, found) if found else "No fields."]
        waiting = [part for kind in _kinds(model) for part in models_in(kind)] + waiting
    text = "\n\n".join(section for section in sections if section)
    for model, page in elsewhere.items():
        text = text.replace(f"(#{anchor(model.__name__)})", f"({page})")
    return text


def in_json(text: str) -> str:
    """Return a text about values of Python as one about values in JSON."""
    return re.sub(r"\bNone\b", "null", text)


def written(kind: str) -> str:
    """Return the type of an entry that people write: one without a value is left out."""
    return kind.replace(" or null", "")


def unlinked(kind: str) -> str:
    """Return a type without links."""
    return re.sub(r"\[(\w+)\]\(#\w+\)", r"`\1`", kind)


def _kinds(model: Model) -> Iterator[Any]:
    if issubclass(model, BaseModel):
        yield from (field.annotation for field in model.model_fields.values())
    else:
        yield from (kind for base in model.__mro__ for kind in _hints(base).values())
