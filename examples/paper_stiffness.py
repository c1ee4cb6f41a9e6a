"""The stiffness twin of the paper's method (eq. 8): a softened stretch of the T-frame's column, and a loosened foot.

Mass is known and stiffness has changed, so measured modes are scaled by the mass, and increments are of flexibility:
of every element in bending and twist, and of the foot's and the joint's springs. The true frame differs in kind from
the reference: 10 mm elements with consistent mass, another Young's modulus, a foot and a joint that give.

Usage: python examples/paper_stiffness.py [FOLDER for the picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from oma import ModalEstimate
from updater import (
    Body,
    StiffnessUpdater,
    Structure,
    build_model,
    learn_reference,
    parse_structure,
    stack_tracks,
    t_structure_toml,
)
from updater.fe import Modes
from updater.structure import Joint, Support

RANDOM = np.random.default_rng(2026)
SOFT = (0.60, 0.72)  # m of the column's height
LOSS, LEFT = 0.3, 0.3  # of the stretch's stiffness; of the foot's about y

# the true frame
nominal = parse_structure(t_structure_toml())
steel = nominal.material["steel"]
true_steel = steel.model_copy(update={"youngs_modulus": 1.015 * steel.youngs_modulus, "density": 0.99 * steel.density})
soft_steel = true_steel.model_copy(
    update={name: (1 - LOSS) * getattr(true_steel, name) for name in ("youngs_modulus", "shear_modulus")}
)
(tube,) = nominal.section.values()
bending = steel.youngs_modulus * tube.second_moment[0] / 1.48  # N m/rad
springs = {"rx": bending / 0.004, "ry": bending / 0.006, "rz": bending / 0.005}
foot = Support.model_validate({"at": (0, 0, 0), "fixed": ("x", "y", "z"), "stiffness": springs})
loose = foot.model_copy(update={"stiffness": {**springs, "ry": LEFT * springs["ry"]}})
joint = Joint.model_validate({"member": "crossbeam", "at": (0, 0, 1.48), "stiffness": springs})
frame = nominal.model_copy(
    update={"material": {"steel": true_steel, "soft": soft_steel}, "support": (foot,), "joint": (joint,)}
)
column, crossbeam = frame.member
parts = [
    column.model_copy(update={"name": f"column {a}", "start": (0, 0, a), "end": (0, 0, b), "material": material})
    for a, b, material in ((0.0, SOFT[0], "steel"), (*SOFT, "soft"), (SOFT[1], 1.48, "steel"))
]
CHANGED = {
    "column softened": frame.model_copy(update={"member": (*parts, crossbeam)}),
    "foot loosened": frame.model_copy(update={"support": (loose,)}),
}


def true_modes(structure: Structure) -> tuple[Modes, np.ndarray]:
    """Return the first eight modes of a true structure, and their shapes at the sensors (8, n_channels)."""
    model = build_model(structure.with_mesh(0.01), shear_flexible=True, mass="consistent")
    modes = model.modes(8)
    shape = (model.sensor_rows @ modes.shape).T
    return modes, shape / np.linalg.norm(shape, axis=1, keepdims=True)


def measured(modes: Modes, shape: np.ndarray, n: int) -> list[ModalEstimate]:
    """Return windows with 0.1 % of noise on a frequency of 10 Hz, less above, and 2 % on shapes."""
    std, shape_std = 1e-3 * np.sqrt(10 / modes.frequency), 0.02 / np.sqrt(shape.shape[1])
    return [
        ModalEstimate(
            channels=nominal.channels,
            frequency=modes.frequency * (1 + std * RANDOM.standard_normal(8)),
            frequency_std=modes.frequency * std,
            damping=np.full(8, 0.005),
            damping_std=np.full(8, 0.001),
            shape=(shape + shape_std * RANDOM.standard_normal(shape.shape)).astype(complex),
            shape_std=np.full(shape.shape, shape_std),
            support=np.ones(8),
            law_ratio=np.ones(8),
            start=0,
            end=60 * 10**9,
        )
        for _ in range(n)
    ]


in_order = [np.arange(8)] * 8  # every window shows the eight modes in order
reference = learn_reference(nominal, measured(*true_modes(frame), 8), in_order)
updater = StiffnessUpdater(reference)
updates = {
    name: updater.update(reference.mean_of(stack_tracks(measured(*true_modes(changed), 4), in_order[:4])))
    for name, changed in CHANGED.items()
}

heavier = frame.with_bodies([Body(at=(0.25, 0.0, 1.48), mass=0.304)])  # stiffness as it was
misread = updater.update(reference.mean_of(stack_tracks(measured(*true_modes(heavier), 4), in_order[:4])))

hinges = updates["foot loosened"].hinges
height = hinges.position[:, 2]
of_column = np.array([name == "column" for name in hinges.name])
bends = {axis: np.flatnonzero(of_column & (hinges.axis == axis)) for axis in (1, 2)}
planes = {1: "in the x-z plane", 2: "in the y-z plane"}
foot_hinge = {1: hinges.name.index("foot 0") + 1, 2: hinges.name.index("foot 0")}  # about y; about x

for name, update in updates.items():
    print(f"\n{name}: {len(update.flagged)} of {len(hinges.name)} hinges flagged, the strongest")
    for i in update.flagged[:3]:
        print(
            f"  {hinges.name[i]:10} at z = {height[i]:.2f} m, axis {hinges.axis[i]}: {100 * update.relative[i]:.1f} % "
            f"of its own flexibility, {update.increment[i] / update.increment_std[i]:.1f} deviations"
        )
    for axis, here in bends.items():
        total = np.nansum(update.normalised[[*here, foot_hinge[axis]]])
        print(f"  total of column and foot {planes[axis]}: {1e6 * total:.2f} rad/(MN m)")
stretch = (SOFT[1] - SOFT[0]) / (true_steel.youngs_modulus * tube.second_moment[0]) * (1 / (1 - LOSS) - 1)
print(f"\ntruly: {1e6 * stretch:.2f} in both planes; {1e6 * (1 / LEFT - 1) / springs['ry']:.2f} in the x-z plane")
print(f"\n304 g added and no stiffness lost: {len(misread.flagged)} of {len(hinges.name)} hinges flagged")

# What eight modes make up: the paper's closing remark
model = build_model(reference.structure)
modes = model.modes(8)
whole = np.linalg.inv(model.stiffness.toarray())
x = model.dofs[(model.nodes[:, 0] == 0) & (model.nodes[:, 2] > 0.1), 0]
shares = {
    "mass of a node": (model.mass.diagonal()[:, None] * modes.shape**2).sum(1)[x],
    "flexibility of a node": ((modes.shape / modes.omega) ** 2).sum(1)[x] / np.diag(whole)[x],
    "flexibility of an element": updates["foot loosened"].share[bends[1]],
}
print("\nShare of the eight modes on the column in x: least, median, most")
for name, share in shares.items():
    print(f"  {name:26}" + "".join(f"{100 * v:6.1f} %" for v in np.quantile(share, (0, 0.5, 1))))

if len(sys.argv) > 1:
    figure = Figure(figsize=(9.5, 8), layout="constrained")
    for row, (name, update) in zip(figure.subplots(2, 2, sharey=True), updates.items(), strict=True):
        raw = "raw", update.increment, update.increment_std
        normalised = "normalised", update.normalised, update.normalised_std
        for axes, (title, values, std) in zip(row, (raw, normalised), strict=True):
            for axis, colour in ((1, "#cc3340"), (2, "#2f6fcc")):
                here = np.array([foot_hinge[axis], *bends[axis]])
                middle, wide = (100 * v[here] / update.flexibility[here] for v in (values, 2 * std))
                axes.fill_betweenx(
                    height[here][1:], (middle - wide)[1:], (middle + wide)[1:], color=colour, alpha=0.2, lw=0
                )
                axes.plot(middle[1:], height[here][1:], color=colour, label=f"bending {planes[axis]}")
                foot_label = "the foot's spring" if axis == 1 else None
                axes.plot(middle[0], 0, "D", color=colour, markeredgecolor="white", markersize=8, label=foot_label)
            axes.axvline(0, color="#66707c", linewidth=0.8)
            place = SOFT if name == "column softened" else (-0.02, 0.02)
            axes.axhspan(*place, color="#1d2733", alpha=0.12, lw=0, label="what was changed")
            axes.set(title=f"{name}: {title}", xlabel="of the hinge's own flexibility, %", ylabel="height, m")
            axes.legend(frameon=False, fontsize=8, loc="upper right")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "paper_stiffness.png", dpi=110)
