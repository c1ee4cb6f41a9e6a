"""Input of CalculiX 2.20 for the files of this folder: a steel strip of two bricks, held at one end.

    python make_strip.py; ccx strip; ccx doubled; ccx modes

`doubled` has twice the modulus in the brick at the held end: the difference of both is the stiffness of the group.
"""

from pathlib import Path

LENGTH, WIDTH, HEIGHT, BRICKS = 0.3, 0.06, 0.01, 2  # m
FORMS = {"strip": (210e9, "MATRIXSTORAGE"), "doubled": (420e9, "MATRIXSTORAGE"), "modes": (210e9, "ARPACK")}


#: nodes of a brick of 20 nodes in halves of its sides, in the order of CalculiX
PATTERN = [
    *((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)),
    *((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)),
    *((0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)),
]


def text(root_modulus: float, solver: str) -> str:
    """Return the input file of one run."""
    bricks = [[(i + 2 * brick, j, k) for i, j, k in PATTERN] for brick in range(BRICKS)]
    number = {place: n for n, place in enumerate(sorted({place for brick in bricks for place in brick}), start=1)}
    lines = ["*HEADING", "strip", "*NODE, NSET=NALL"]
    for (i, j, k), n in number.items():
        lines.append(f"{n}, {LENGTH * i / (2 * BRICKS):g}, {WIDTH * j / 2:g}, {HEIGHT * k / 2:g}")
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=EALL")
    for n, brick in enumerate(bricks, start=1):
        nodes = [str(number[place]) for place in brick]
        lines += [", ".join([str(n), *nodes[:10]]) + ",", ", ".join(nodes[10:])]
    held = [n for place, n in number.items() if place[0] == 0]
    lines += ["*ELSET, ELSET=ROOT", "1", "*ELSET, ELSET=REST", "2"]
    for name, modulus in (("ROOT", root_modulus), ("REST", 210e9)):
        lines += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{modulus:g}, 0.3", "*DENSITY", "7850"]
        lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}")
    lines += ["*BOUNDARY", *(f"{n}, 1, 3" for n in held)]
    return "\n".join([*lines, "*STEP", f"*FREQUENCY, SOLVER={solver}", "5", "*END STEP", ""])


if __name__ == "__main__":
    for name, (modulus, solver) in FORMS.items():
        Path(f"{name}.inp").write_text(text(modulus, solver), encoding="utf-8")
