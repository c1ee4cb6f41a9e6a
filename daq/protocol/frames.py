"""Classic CAN frames by the block, whatever brought them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

EXTENDED = 0x8000_0000  #: bit of an id: 29 bits long (as in Linux's `struct can_frame`)
REMOTE = 0x4000_0000  #: bit of an id: remote frame without data
NUMBER = 0x1FFF_FFFF  #: bits of an id that are sent


@dataclass(frozen=True, eq=False)
class CanFrames:
    """Frames in the order of the bus."""

    ids: npt.NDArray[np.uint32]  #: (n,) identifier, with the bits EXTENDED and REMOTE
    dlc: npt.NDArray[np.uint8]  #: (n,) bytes of data, at most 8
    data: npt.NDArray[np.uint8]  #: (n, 8), zero from byte `dlc` on

    def __post_init__(self) -> None:
        """Check that shapes agree."""
        n = len(self.ids)
        if self.dlc.shape != (n,) or self.data.shape != (n, 8):
            raise ValueError(
                f"frames: expected dlc ({n},) and data ({n}, 8), found {self.dlc.shape}, {self.data.shape}"
            )

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, which: npt.NDArray[Any] | slice) -> "CanFrames":
        """Return some of the frames, by mask, indices or slice."""
        return CanFrames(self.ids[which], self.dlc[which], self.data[which])

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Yield (id, data) of each frame."""
        content = self.data.tobytes()
        for k, (number, size) in enumerate(zip(self.ids.tolist(), self.dlc.tolist(), strict=True)):
            yield number, content[8 * k : 8 * k + size]


NO_FRAMES = CanFrames(np.zeros(0, np.uint32), np.zeros(0, np.uint8), np.zeros((0, 8), np.uint8))


def can_frames(frames: Sequence[tuple[int, bytes]]) -> CanFrames:
    """Return frames given one by one as (id, data)."""
    data = np.zeros((len(frames), 8), np.uint8)
    for row, (_, content) in zip(data, frames, strict=True):
        row[: len(content)] = np.frombuffer(content, np.uint8)
    ids, sizes = [number for number, _ in frames], [len(content) for _, content in frames]
    return CanFrames(np.array(ids, np.uint32), np.array(sizes, np.uint8), data)


def concatenate(parts: Sequence[CanFrames]) -> CanFrames:
    """Return frames of at least one block, one block after another."""
    if len(parts) == 1:
        return parts[0]
    return CanFrames(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("ids", "dlc", "data")))
