"""Frozen dataclasses of numbers and arrays as JSON and back, to the last bit, by their own type hints.

An array is {"dtype", "shape", "data"}, its bytes little-endian in base 64; not-a-number and infinity are JSON as Python
spells them. Only types named by the hints are ever made, so that a file of others can be wrong, but cannot execute
anything.
"""

import base64
import binascii
import dataclasses
import types
import typing
from collections.abc import Mapping
from typing import Any

import numpy as np

_KINDS = "fciub"  # of arrays: float, complex, int, unsigned, bool
_PLAIN: tuple[type, ...] = (bool, int, float, str)


class CodecError(ValueError):
    """Values that do not match the type hints; names the place."""


def encode(value: Any) -> Any:  # noqa: ANN401 - any value of a dataclass's fields
    """Return JSON values of a dataclass, array, mapping, sequence or plain value."""
    if dataclasses.is_dataclass(value):
        return {name: encode(getattr(value, name)) for name in stored_fields(type(value))}
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        array = array.astype(array.dtype.newbyteorder("<"))
        data = base64.b64encode(array.tobytes()).decode()
        return {"dtype": array.dtype.str, "shape": list(array.shape), "data": data}
    if isinstance(value, Mapping):
        return {str(key): encode(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [encode(item) for item in value]
    return value


def stored_fields(kind: Any) -> list[str]:  # noqa: ANN401 - a dataclass or one of its objects
    """Return the names of the fields that are stored: those that are not marked `{"stored": False}`."""
    return [f.name for f in dataclasses.fields(kind) if f.metadata.get("stored", True)]


def decode(kind: Any, values: Any, place: str = "") -> Any:  # noqa: ANN401 - what the hint says
    """Return the value represented by JSON.

    Parameters
    ----------
    kind : type hint
    values : from JSON
    place : named in errors

    Raises
    ------
    CodecError
        Naming the place, the found and the expected value; also if the values are invalid for the type.
    """
    origin, inside = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        return _dataclass(kind, values, place)
    if origin is np.ndarray:
        return _array(values, place)
    if origin in (typing.Union, types.UnionType):
        return None if values is None else decode(inside[0], values, place)
    if origin is typing.Literal:
        return _checked(values in inside, values, place, f"one of {', '.join(map(str, inside))}")
    if origin is tuple:
        _checked(isinstance(values, list), values, place, "a list")
        kinds = (inside[0],) * len(values) if inside[-1] is Ellipsis else inside
        _checked(len(kinds) == len(values), values, place, f"{len(kinds)} values")
        return tuple(decode(k, v, f"{place}[{i}]") for i, (k, v) in enumerate(zip(kinds, values, strict=True)))
    if origin is not None and issubclass(origin, Mapping):
        _checked(isinstance(values, dict), values, place, "an object")
        return {key: decode(inside[1], value, f"{place}.{key}") for key, value in values.items()}
    _checked(kind in _PLAIN, kind, place, "a type that this codec knows")
    number = kind is float and isinstance(values, int) and not isinstance(values, bool)
    return _checked(number or type(values) is kind, values, place, kind.__name__)


def _dataclass(kind: Any, values: Any, place: str) -> Any:  # noqa: ANN401
    names = set(stored_fields(kind))
    _checked(isinstance(values, dict) and values.keys() == names, values, place, f"an object of {sorted(names)}")
    hints = typing.get_type_hints(kind)
    found = {name: decode(hints[name], values[name], f"{place}.{name}".lstrip(".")) for name in names}
    try:
        return kind(**found)
    except ValueError as error:
        raise CodecError(f"{place}: {error}") from error


def _array(values: Any, place: str) -> Any:  # noqa: ANN401
    try:
        dtype = np.dtype(values["dtype"])
        _checked(dtype.kind in _KINDS, str(dtype), place, "an array of numbers")
        array = np.frombuffer(base64.b64decode(values["data"], validate=True), dtype).reshape(values["shape"])
    except (KeyError, TypeError, ValueError, binascii.Error) as error:
        raise CodecError(f"{place}: expected an array, found {str(values)[:60]}: {error}") from error
    return array.astype(dtype.newbyteorder("="))


def _checked(right: bool, value: Any, place: str, expected: str) -> Any:  # noqa: ANN401
    if not right:
        raise CodecError(f"{place or 'contents'}: expected {expected}, found {str(value)[:60]!r}")
    return value
