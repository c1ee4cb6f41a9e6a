"""structure.toml changed where a structure has changed: comments, order and figures stay as they were written.

Entries of a list are matched by name, channel or position. Derived values (a section by its shape, elements by the
mesh) remain derived until they change.
"""

from collections import Counter
from collections.abc import MutableMapping
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import AoT, Comment, Item, Table, Trivia, Whitespace
from tomlkit.items import Float as TomlFloat

Content = dict[str, Any]
Key = tuple[object, ...]

#: fields that identify the entries of a list
_NAMES: dict[str, tuple[str, ...]] = {
    "member": ("name",),
    "sensor": ("channel",),
    "support": ("at",),
    "joint": ("member", "at"),
    "segment": ("member", "at", "extent"),
    "body": ("at",),
    "oscillator": ("at", "direction"),
    "ground": ("at", "axis"),
    "breathing_crack": ("member", "at", "axis"),
}


def rewrite(text: str, old: Content, new: Content, brief: Content, note: str) -> str:
    """Return the text with the differences between two contents.

    Parameters
    ----------
    text : TOML that `old` was read from
    old, new : all fields of the structure as it was and as it is now
    brief : `new` without default values, for entries that are added
    note : comment put into entries that are added, and at values of sensors that differ, or nothing
    """
    document = tomlkit.parse(text)
    for key in (key for key in new if new[key] != old[key]):
        if key in _NAMES:
            _rewrite_list(document, key, old[key], new[key], brief.get(key, []), note)
        elif key == "sensors":
            _rewrite_corrections(document, old[key], new[key], brief.get(key, {}), note)
        elif isinstance(new[key], dict) and key in document:
            _merge(document[key], old[key], new[key])
        else:
            _set(document, key, new[key])
    return tomlkit.dumps(document)


def _rewrite_corrections(document: tomlkit.TOMLDocument, old: Content, new: Content, brief: Content, note: str) -> None:
    """Give each sensor that is corrected a table of its own, and take out those that no longer are."""
    if "sensors" not in document:
        document.append("sensors", tomlkit.table(is_super_table=True))
    tables: Any = document["sensors"]
    for name in [name for name in tables if name not in new]:
        del tables[name]
    for name in [name for name in new if new[name] != old.get(name)]:
        if name in tables:
            _merge(tables[name], old[name], new[name])
        else:
            table = _table(brief[name], note)
            table.trivia.indent = "\n" if len(tables) else ""  # the first is separated by a blank line
            tables.append(name, table)
    if not tables:
        del document["sensors"]


def _merge(table: Any, old: Content, new: Content) -> None:  # noqa: ANN401  tomlkit's tables have no common type
    """Change a table's values where they differ, and remove obsolete ones."""
    worked_out = any(key not in new for key in table)  # such as `shape`, which replaces other keys
    for key, value in new.items():
        if key in old and old[key] == value and not (worked_out and key not in table):
            continue
        if isinstance(value, dict) and key in table:
            _merge(table[key], old.get(key) or {}, value)
        else:
            _set(table, key, value)
    for key in [key for key in table if key not in new]:
        del table[key]


def _set(table: MutableMapping[str, Any], key: str, value: object) -> None:
    if value is None:
        table.pop(key, None)
    elif key in table or not isinstance(table, Table):
        table[key] = _item(value)
    else:  # before blank lines and comments at the end, which belong to the following entry
        tail = _cut_tail(table)
        table[key] = _item(value)
        for item in tail:
            table.value.append(None, item)


def _item(value: object) -> Item:
    """Return a value as TOML; large and small figures in scientific notation, exactly."""
    if isinstance(value, float) and value and not 1e-4 <= abs(value) < 1e7:
        return TomlFloat(value, Trivia(), np.format_float_scientific(value, trim="0", exp_digits=1).replace("e+", "e"))
    if isinstance(value, list):
        found = tomlkit.array()
        for part in value:
            found.append(_item(part))
        return found
    if isinstance(value, dict):
        inline = tomlkit.inline_table()
        for key, part in value.items():
            inline.append(key, _item(part))
        return inline
    return tomlkit.item(value)


def _rewrite_list(
    document: tomlkit.TOMLDocument, key: str, old: list[Content], new: list[Content], brief: list[Content], note: str
) -> None:
    before, after = _keys(key, old), _keys(key, new)
    kept = [k for k in before if k in after]
    if not kept or kept != after[: len(kept)]:  # new, all gone, or in another order
        document.pop(key, None)
        if brief:
            document.append(key, _array(brief, note))
        return
    entries: Any = document[key]
    for row in reversed(range(len(before))):
        if before[row] not in after:
            del entries[row]
    for row, k in enumerate(kept):
        if old[before.index(k)] != new[row]:
            _merge(entries[row], old[before.index(k)], new[row])
            if note and key == "sensor" and isinstance(entries, AoT):
                _comment(entries[row], old[before.index(k)], new[row], note)
    for content in brief[len(kept) :]:
        _append(entries, content, note)


def _comment(table: Any, old: Content, new: Content, note: str) -> None:  # noqa: ANN401  a tomlkit table
    """State at each value that differs what it was, unless it has a comment of its own."""
    for name in (name for name, value in new.items() if value != old[name] and name in table):
        if not table[name].trivia.comment:
            table[name].comment(f"{note}; was {old[name]}")


def _array(entries: list[Content], note: str) -> AoT:
    tables = [_table(content, note) for content in entries]
    for table in tables:
        table.trivia.indent = "\n"
    return AoT(tables)


def _table(content: Content, note: str) -> Table:
    table = tomlkit.table()
    if note:
        table.add(tomlkit.comment(note))
    for key, value in content.items():
        table.append(key, _item(value))
    return table


def _keys(key: str, entries: list[Content]) -> list[Key]:
    """Return the identity of each entry; for several at a position, their number."""
    seen: Counter[str] = Counter()
    found: list[Key] = []
    for entry in entries:
        name = repr([entry[field] for field in _NAMES[key]])
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def _append(entries: Any, content: Content, note: str) -> None:  # noqa: ANN401  an array of tables, or of inline ones
    """Append an entry after the last; trailing comments belong to the following entry, and stay there."""
    if not isinstance(entries, AoT):
        entries.append(_item(content))
        return
    tail = _cut_tail(entries[-1])
    entries[-1].add(tomlkit.nl())
    entries.append(_table(content, note))
    for item in tail:
        entries[-1].value.append(None, item)


def _cut_tail(table: Table) -> list[Item]:
    """Take blank lines and comments off the end of a table."""
    body = table.value.body
    keep = len(body)
    while keep and isinstance(body[keep - 1][1], Comment | Whitespace):
        keep -= 1
    tail = [item for _, item in body[keep:]]
    del body[keep:]
    return tail
