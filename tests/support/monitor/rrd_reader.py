"""Reads an .rrd file back: entities, rows and the views of its blueprint."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rerun.chunk import Chunk, RrdReader

_CONTENT = {
    "Scalars:scalars",
    "Measurements:values",
    "TextDocument:text",
    "TextLog:text",
    "StateChange:state",
    "LineStrips2D:strips",
    "LineStrips3D:strips",
    "Image:buffer",
    "Points2D:labels",
}


@dataclass(frozen=True)
class View:
    """A view of a blueprint."""

    kind: str
    name: str
    origin: str


class Rrd:
    """Content of an .rrd file."""

    def __init__(self, path: Path) -> None:
        reader = RrdReader(path)
        self.recordings = reader.recordings()
        self.chunks: list[Chunk] = reader.stream().collect().stream().to_chunks()
        self.views = [
            view
            for blueprint in reader.blueprints()
            for chunk in reader.stream(store=blueprint).to_chunks()
            if (view := _view(chunk)) is not None
        ]

    def entities(self, origin: str = "/") -> set[str]:
        """Return the entities at or under an origin that hold something to see, not only a style."""
        root = origin.rstrip("/")
        return {
            c.entity_path
            for c in self.chunks
            if (c.entity_path + "/").startswith(root + "/") and _CONTENT & set(c.to_record_batch().schema.names)
        }

    def rows(self, entity: str, component: str, timeline: str = "time") -> tuple[npt.NDArray[np.int64], list[Any]]:
        """Return times [ns] and rows of a component on a timeline, in the order of time."""
        found: list[tuple[int, Any]] = []
        for batch in self._batches(entity, component):
            if timeline in batch.schema.names:
                times = batch.column(timeline).cast("int64").to_pylist()
                rows = batch.column(component).to_pylist()
                found += [(t, row) for t, row in zip(times, rows, strict=True) if row is not None]
        found.sort(key=lambda pair: pair[0])
        return np.array([t for t, _ in found], np.int64), [row for _, row in found]

    def static(self, entity: str, component: str) -> Any:
        """Return the static row of a component."""
        rows = [
            row
            for batch in self._batches(entity, component)
            if not {"time", "phase"} & set(batch.schema.names)
            for row in batch.column(component).to_pylist()
        ]
        assert rows, f"{entity} has no static {component}"
        return rows[-1]

    def scalars(self, entity: str) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Return times [ns] and values of a series."""
        times, rows = self.rows(entity, "Scalars:scalars")
        return times, np.array([row[0] for row in rows], float)

    def _batches(self, entity: str, component: str) -> list[Any]:
        batches = [c.to_record_batch() for c in self.chunks if c.entity_path == entity]
        return [b for b in batches if component in b.schema.names]


def _view(chunk: Chunk) -> View | None:
    batch = chunk.to_record_batch()
    names = ("class_identifier", "display_name", "space_origin")
    if f"ViewBlueprint:{names[0]}" not in batch.schema.names:
        return None
    return View(*(batch.column(f"ViewBlueprint:{name}").to_pylist()[-1][0] for name in names))
