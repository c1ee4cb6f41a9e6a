"""Portals of thin tube by a finite element code of their own, as they are and as their owner's file describes them.

Beam elements with consistent mass (Przemieniecki 1968, ch. 11), 32 per member. The file has another modulus and
density, elements of 40 mm and shear-flexible beams. The feet have springs; a post may have a hinge, as a crack.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from updater import Structure, parse_structure

LEFT = 2000.0  #: of both feet in the file [N m/rad]
MODULUS, SHEAR, DENSITY = 212e9, 81.5e9, 7830.0
PLACES = ("left", 0.5), ("beam", 0.0), ("beam", 0.25), ("beam", 0.625), ("right", 0.625)
AXES = "xy", "xy", "yz", "yz", "xy"
SENSOR = 0.02  # kg
TINY = 1e-9  # kg m2: with the spring of a foot, a mode far beyond those that are kept
_N = 32  # elements per member


@dataclass(frozen=True)
class Load:
    """A rigid body at a node near a point of a member, its centre off the axis."""

    member: str
    share: float  #: of the member's length
    mass: float  #: [kg]
    offset: tuple[float, float, float]  #: [m]

    @property
    def matrix(self) -> np.ndarray:
        """Mass (6, 6) of the node."""
        x, y, z = self.offset
        arm = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
        return np.asarray(self.mass * arm.T @ arm)


@dataclass(frozen=True)
class Portal:
    """Two posts and a beam of box section; dimensions in m."""

    across: float  #: outer side of the section in the plane
    along: float  #: and out of it
    wall: float
    height: float
    width: float

    @property
    def section(self) -> tuple[float, float, float, float]:
        """Area, second moments about y and in the plane's normal direction, torsion constant."""
        b, d, t = self.across, self.along, self.wall
        area = b * d - (b - 2 * t) * (d - 2 * t)
        in_plane = (d * b**3 - (d - 2 * t) * (b - 2 * t) ** 3) / 12
        out_of_plane = (b * d**3 - (b - 2 * t) * (d - 2 * t) ** 3) / 12
        return area, in_plane, out_of_plane, 2 * t * ((b - t) * (d - t)) ** 2 / (b + d - 2 * t)

    def at(self, member: str, share: float) -> tuple[float, float, float]:
        """Return a point of a member, that far up a post or along the beam."""
        if member == "beam":
            return share * self.width, 0.0, self.height
        return (0.0 if member == "left" else self.width), 0.0, share * self.height

    def sensors(self) -> dict[str, tuple[tuple[float, float, float], int]]:
        """Return the place and axis of each channel."""
        return {
            f"{member}_{share:g}_{axis}": (self.at(member, share), "xyz".index(axis))
            for (member, share), axes in zip(PLACES, AXES, strict=True)
            for axis in axes
        }

    def file(self) -> Structure:
        """Return the structure as its owner describes it."""
        return parse_structure(self.file_text())

    def file_text(self, *, rigid: bool = False) -> str:
        """Return the text of the owner's file; where the feet are not known to yield, they are rigid in it."""
        area, in_plane, out_of_plane, torsion = self.section
        lines = [
            'name = "portal"\n[mesh]\nelement_length = 0.04',
            "[material.steel]\nyoungs_modulus = 210e9\nshear_modulus = 80.8e9\ndensity = 7850",
            f"[section.tube]\narea = {area}\nsecond_moment = [{in_plane}, {out_of_plane}]",
            f"torsion_constant = {torsion}\nshear_factor = 0.44",
        ]
        ends = {
            "left post": ((0.0, 0.0, 0.0), self.at("left", 1.0)),
            "right post": (self.at("right", 0.0), self.at("right", 1.0)),
            "beam": (self.at("left", 1.0), self.at("right", 1.0)),
        }
        for name, (start, end) in ends.items():
            lines.append(f'[[member]]\nname = "{name}"\nfrom = {list(start)}\nto = {list(end)}')
            lines.append('material = "steel"\nsection = "tube"\nlocal_y = [0.0, 1.0, 0.0]')
        for foot in (self.at("left", 0.0), self.at("right", 0.0)):
            held = ["x", "y", "z", *(["rx", "ry", "rz"] if rigid else [])]
            lines.append(f"[[support]]\nat = {list(foot)}\nfixed = {held}")
            if not rigid:
                lines.append(f"stiffness = {{rx = {LEFT}, ry = {LEFT}, rz = {LEFT}}}")
        for channel, (at, axis) in self.sensors().items():
            direction = [float(k == axis) for k in range(3)]
            lines.append(f'[[sensor]]\nchannel = "{channel}"\nat = {list(at)}\ndirection = {direction}')
        lines += [f"[[body]]\nat = {list(self.at(*place))}\nmass = {SENSOR}" for place in PLACES]
        return "\n".join(lines)

    def matrices(
        self, foot: float, crack: float | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return stiffness and mass, nodes (n_nodes, 3) and the row (n_dofs,) that reads the rotation of a crack.

        Parameters
        ----------
        foot : stiffness of the right foot [N m/rad]
        crack : place up the left post as a share of its height: a hinge in the plane, without a spring
        """
        rise = np.linspace(0, self.height, _N + 1)
        node = [(0.0, 0.0, z) for z in rise]
        node += [(x, 0.0, self.height) for x in np.linspace(0, self.width, _N + 1)[1:]]
        node += [(self.width, 0.0, z) for z in rise[-2::-1]]
        point = np.array(node)
        last = 6 * len(point)  # the upper side of a crack turns by a degree of freedom of its own
        stiffness, mass = np.zeros((2, last + 1, last + 1))
        jump = np.zeros(last + 1)
        for k in range(len(point) - 1):
            along = point[k + 1] - point[k]
            length = float(np.linalg.norm(along))
            frame = np.array([along / length, (0, 1, 0), np.cross(along / length, (0, 1, 0))])
            turn, dofs = np.kron(np.eye(4), frame), np.arange(6 * k, 6 * k + 12)
            if crack is not None and k == round(crack * _N):
                jump[last], jump[dofs[4]] = 1.0, -1.0
                mass[dofs[4], dofs[4]] += TINY  # below a hinge at the foot there is no element
                dofs[4] = last
            own = np.ix_(dofs, dofs)
            for whole, element in zip((stiffness, mass), self._element(length), strict=True):
                whole[own] += turn.T @ element @ turn
        for first, spring in ((0, LEFT), (last - 6, foot)):
            stiffness[range(first, first + 6), range(first, first + 6)] += [*3 * [1e10], spring, spring, LEFT]
        for place in PLACES:
            first = 6 * self._nearest(point, self.at(*place))
            mass[range(first, first + 3), range(first, first + 3)] += SENSOR
        kept = slice(None) if crack is not None else slice(last)
        return stiffness[kept, kept], mass[kept, kept], point, jump

    def rows(self, point: np.ndarray) -> list[int]:
        """Return the degree of freedom of each channel."""
        return [6 * self._nearest(point, at) + axis for at, axis in self.sensors().values()]

    def modes(self, foot: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frequencies [Hz], and mass-normalised shapes at the sensors and at all nodes (n_nodes, 3, n_modes)."""
        stiffness, mass, point, _ = self.matrices(foot)
        square, shape = scipy.linalg.eigh(stiffness, mass, subset_by_index=(0, 24))
        return np.sqrt(square) / (2 * np.pi), shape[self.rows(point)], shape.reshape(len(point), 6, -1)[:, :3]

    def loaded(self, load: Load) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return frequencies [Hz], shapes at the sensors, the share of each bare mode in each, and the loaded node.

        The share (n_modes, n_modes) is of the kinetic energy, by mass-normalised shapes.
        """
        stiffness, mass, point, _ = self.matrices(LEFT)
        _, bare = scipy.linalg.eigh(stiffness, mass, subset_by_index=(0, 24))
        node = int(np.argmin(np.linalg.norm(point - self.at(load.member, load.share), axis=1)))
        own = slice(6 * node, 6 * node + 6)
        mass[own, own] += load.matrix
        square, shape = scipy.linalg.eigh(stiffness, mass, subset_by_index=(0, 24))
        share = (bare.T @ mass @ shape) ** 2 / np.einsum("ik,ij,jk->k", bare, mass, bare)[:, None]
        return np.sqrt(square) / (2 * np.pi), shape[self.rows(point)], share, point[node]

    @staticmethod
    def _nearest(point: np.ndarray, at: tuple[float, float, float]) -> int:
        away = np.linalg.norm(point - at, axis=1)
        assert away.min() < 1e-9
        return int(np.argmin(away))

    def _element(self, length: float) -> tuple[np.ndarray, np.ndarray]:
        """Return stiffness and consistent mass (12, 12) of a Bernoulli beam along x, by nodes x y z rx ry rz."""
        area, in_plane, out_of_plane, torsion = self.section
        stiffness, mass = np.zeros((2, 12, 12))
        for k, rigidity, per_density in ((0, MODULUS * area, area), (3, SHEAR * torsion, in_plane + out_of_plane)):
            dofs = np.ix_((k, k + 6), (k, k + 6))
            stiffness[dofs] += rigidity / length * np.array([[1, -1], [-1, 1]])
            mass[dofs] += DENSITY * per_density * length / 6 * np.array([[2, 1], [1, 2]])
        h = length
        bending = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
        bending += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
        inertia = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
        inertia += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
        for moment, own, sign in ((out_of_plane, (1, 5, 7, 11), 1), (in_plane, (2, 4, 8, 10), -1)):
            turn = np.diag([1, sign, 1, sign])
            stiffness[np.ix_(own, own)] += MODULUS * moment / h**3 * turn @ bending @ turn
            mass[np.ix_(own, own)] += DENSITY * area * h / 420 * turn @ inertia @ turn
        return stiffness, mass
