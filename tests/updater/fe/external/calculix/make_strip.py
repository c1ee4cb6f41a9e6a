"""Input of CalculiX 2.20 for the files of this folder: a steel strip of five bricks, held at one end.

    python make_strip.py; ccx strip; ccx doubled; ccx modes

`doubled` has twice the modulus in the brick at the held end: the difference of both is the stiffness of the group.
"""

from pathlib import Path

LENGTH, WIDTH, HEIGHT, BRICKS = 0.4, 0.06, 0.01, 5  # m
FORMS = {"strip": (210e9, "MATRIXSTORAGE"), "doubled": (420e9, "MATRIXSTORAGE"), "modes": (210e9, "ARPACK")}


def text(root_modulus: float, solver: str) -> str:
    """Return the input file of one run."""
    nodes = [(LENGTH * i / BRICKS, y, z) for i in range(BRICKS + 1) for y in (0.0, WIDTH) for z in (0.0, HEIGHT)]
    lines = ["*HEADING", "strip", "*NODE, NSET=NALL"]
    lines += [f"{number}, {x:g}, {y:g}, {z:g}" for number, (x, y, z) in enumerate(nodes, start=1)]
    lines.append("*ELEMENT, TYPE=C3D8I, ELSET=EALL")
    for brick in range(BRICKS):
        first = 4 * brick
        corners = [first + k for k in (1, 5, 7, 3, 2, 6, 8, 4)]
        lines.append(", ".join(map(str, [brick + 1, *corners])))
    lines += ["*ELSET, ELSET=ROOT", "1", "*ELSET, ELSET=REST, GENERATE", f"2, {BRICKS}"]
    for name, modulus in (("ROOT", root_modulus), ("REST", 210e9)):
        lines += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{modulus:g}, 0.3", "*DENSITY", "7850"]
        lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}")
    lines += ["*BOUNDARY", *(f"{node}, 1, 3" for node in range(1, 5))]
    return "\n".join([*lines, "*STEP", f"*FREQUENCY, SOLVER={solver}", "5", "*END STEP", ""])


if __name__ == "__main__":
    for name, (modulus, solver) in FORMS.items():
        Path(f"{name}.inp").write_text(text(modulus, solver), encoding="utf-8")
