"""Positions of sensors, with lines between them, for pictures of a site without a model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from daq import FloatArray
from oma import ComplexArray, Place, node_motion
from updater.quantities import Vector, vector


@dataclass(frozen=True, kw_only=True)
class SensorGeometry:
    """Positions and directions of channels, and the lines that join the positions."""

    sensors: Mapping[str, tuple[Vector, Vector]]  #: channel -> position [m], direction of any length
    lines: Sequence[Sequence[str]] = ()  #: channels whose positions follow each other; none: nearest neighbours

    @property
    def nodes(self) -> list[Vector]:
        """Return the positions, each once [m]."""
        return list(dict.fromkeys(at for at, _ in self.sensors.values()))

    @property
    def chains(self) -> list[list[int]]:
        """Return the nodes along each line; without lines the shortest set of straight lines that joins all nodes."""
        number = {at: k for k, at in enumerate(self.nodes)}
        if self.lines:
            return [[number[self.sensors[channel][0]] for channel in line] for line in self.lines]
        from scipy.sparse.csgraph import minimum_spanning_tree  # slow to import, and seldom used

        at = np.array(self.nodes)
        tree = minimum_spanning_tree(np.linalg.norm(at[:, None] - at[None], axis=2)).tocoo()
        return [[int(a), int(b)] for a, b in zip(tree.row, tree.col, strict=True)]

    @property
    def axis_lines(self) -> FloatArray:
        """Return the ends (n_lines, 2, 3) of the lines between the positions [m]."""
        at = np.array(self.nodes)
        return np.array([at[list(pair)] for chain in self.chains for pair in pairwise(chain)])

    @property
    def measuring_axes(self) -> Mapping[str, tuple[Vector, Vector]]:
        """Return position [m] and direction of each channel."""
        return self.sensors

    @property
    def places(self) -> dict[str, Place]:
        """Return node, counted from 1, and unit vector of each channel."""
        number = {at: k for k, at in enumerate(self.nodes, 1)}
        return {
            channel: Place(node=number[at], direction=vector(np.array(way) / np.linalg.norm(way)))
            for channel, (at, way) in self.sensors.items()
        }

    def displacement(self, channels: Sequence[str], shape: FloatArray | ComplexArray) -> ComplexArray:
        """Return the motion (n_modes, n_nodes, 3) that measured shapes state; 0 in directions that are not measured.

        Parameters
        ----------
        channels : of the shapes; those without a position are not used
        shape : (n_modes, n_channels)
        """
        numbers, motion = node_motion(channels, shape, self.places)
        moved = np.zeros((len(shape), len(self.nodes), 3), complex)
        moved[:, [number - 1 for number in numbers]] = motion
        return moved
