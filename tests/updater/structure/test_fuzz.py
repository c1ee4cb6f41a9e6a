"""Any content of a structure file is a structure or one line that names the file."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import tomlkit
from hypothesis import given, settings
from hypothesis import strategies as st

from updater import ModelError, StructureError, build_model, parse_structure

TEXT = (Path(__file__).parents[3] / "examples" / "portal_frame.toml").read_text(encoding="utf-8")

numbers = st.sampled_from([0, -1, 0.0, -0.5, 1e-300, 1e300, 2**70, float("inf"), float("nan"), 1.2])
values = st.recursive(
    numbers | st.booleans() | st.sampled_from(["", "steel", "x", "box", "\N{BELL}", "left post"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["x", "name", "shape", "at"]), inner, max_size=3)
    ),
    max_leaves=6,
)


def _leaves(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths to every value and table."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [path] * bool(path) + [leaf for key, value in items for leaf in _leaves(value, (*path, key))]


LEAVES = _leaves(tomllib.loads(TEXT))


@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_random_file_content_is_accepted_or_gives_one_error(data: st.DataObject) -> None:
    content: Any = copy.deepcopy(tomllib.loads(TEXT))
    path = data.draw(st.sampled_from(LEAVES))
    inside = content
    for key in path[:-1]:
        inside = inside[key]
    if data.draw(st.booleans()):
        inside[path[-1]] = data.draw(values)
    else:
        del inside[path[-1]]
    reported = _said(tomlkit.dumps(content))
    assert reported is None or (reported.startswith("frame.toml: ") and "\n" not in reported)


def _said(text: str) -> str | None:
    try:
        build_model(parse_structure(text, "frame.toml"))
    except StructureError as error:
        return str(error)
    except ModelError as error:
        return f"frame.toml: {error}"
    return None
