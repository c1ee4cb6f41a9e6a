"""Coordinate systems in a file of pyNastran 1.4.1, with the positions and axes that it gives.

Run in an environment of its own, because pyNastran 1.4 needs numpy below 2:

    pip install pyNastran==1.4.1 'numpy<2'
    python make_coordinates.py
"""

import numpy as np
from pyNastran.bdf.bdf import BDF

model = BDF(debug=False)
model.add_cord2c(1, [0.4, -0.2, 0.1], [0.5, 0.3, 0.9], [1.4, 0.1, 0.2], rid=0)
model.add_cord2r(2, [0.3, 40.0, 0.2], [0.6, 70.0, 1.1], [1.2, -20.0, 0.4], rid=1)  # about the cylinder
model.add_cord2s(3, [0.1, 0.2, -0.3], [0.4, -0.2, 0.7], [0.9, 0.5, 0.1], rid=2)
model.add_grid(1, [0.7, 25.0, 0.3], cp=1, cd=2)
model.add_grid(2, [0.2, -0.4, 0.6], cp=2, cd=1)
model.add_grid(3, [0.8, 65.0, 130.0], cp=3, cd=3)
model.add_cord1r(4, 1, 2, 3)  # through grid points that are in other systems
model.add_cord1c(5, 3, 1, 2)
model.add_grid(4, [0.1, 0.2, 0.3], cp=4, cd=5)
model.add_grid(5, [0.6, -110.0, 0.4], cp=5, cd=4)
model.add_grid(6, [1.0, 2.0, 3.0])
model.write_bdf("coordinates.bdf", size=16, is_double=True)
model = BDF(debug=False)
model.read_bdf("coordinates.bdf", punch=True)
lines = ["node,x,y,z," + ",".join(f"{a}{b}" for a in "123" for b in "xyz")]
for number, node in sorted(model.nodes.items()):
    point = node.get_position()
    system = node.cd_ref
    local = np.array(system.transform_node_to_local(point), float)
    unit = np.eye(3)
    if system.type[-1] == "R":
        axes = system.beta()
    else:  # by differences of positions
        h, axes = 1e-6, np.zeros((3, 3))
        for k in range(3):
            step = np.zeros(3)
            step[k] = h if k == 0 or (k == 2 and system.type[-1] == "C") else np.degrees(h)
            ahead, back = (system.transform_node_to_global(local + s * step) for s in (1, -1))
            axes[k] = (ahead - back) / np.linalg.norm(ahead - back)
    lines.append(",".join([str(number), *(f"{v:.12g}" for v in [*point, *axes.ravel()])]))
with open("coordinates.csv", "w", encoding="utf-8") as file:
    file.write("\n".join(lines) + "\n")
