"""Causes that other distributions bring, by the entry-point group `modalwatch.causes`."""

import logging
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points

from updater.causes.base import Cause, Propose

GROUP = "modalwatch.causes"
_log = logging.getLogger(__name__)


class Catalogue(Mapping[str, Propose[Cause]]):
    """Our own causes, and after them those that are installed, which are looked for when first asked for.

    Parameters
    ----------
    own : causes by name, which no other can replace
    """

    def __init__(self, own: Mapping[str, Propose[Cause]]) -> None:
        self._own = own

    @cached_property
    def _all(self) -> Mapping[str, Propose[Cause]]:
        found = dict(self._own)
        for entry in sorted(entry_points(group=GROUP), key=lambda e: e.name):
            propose = _usable(entry, found)
            if propose is not None:
                found[entry.name] = propose
        return found

    def __getitem__(self, name: str) -> Propose[Cause]:
        """Return what proposes a cause."""
        return self._all[name]

    def __iter__(self) -> Iterator[str]:
        """Go through the names, our own first."""
        return iter(self._all)

    def __len__(self) -> int:
        """Count them."""
        return len(self._all)


def _usable(entry: EntryPoint, known: Mapping[str, object]) -> Propose[Cause] | None:
    """Load a cause; one that cannot be used is named and left out, so that the others can be."""
    try:
        propose = entry.load()
    except Exception as error:  # noqa: BLE001 - a stranger's module may raise anything at all
        problem = f"{type(error).__name__}: {error}"
    else:
        if entry.name not in known and callable(propose):
            return propose  # type: ignore[no-any-return]
        problem = "that name is taken" if entry.name in known else f"expected a function, found {propose!r}"
    _log.warning("cause %s (%s) is left out: %s", entry.name, entry.value, " ".join(problem.split()))
    return None
