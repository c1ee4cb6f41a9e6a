"""Command `new external`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force, one_of


def external(
    stiffness: Annotated[
        Path,
        Argument(metavar="STIFFNESS", help="Stiffness matrix of Abaqus, CalculiX, Ansys (HBMAT) or Nastran (OP4)."),
    ],
    mass: Annotated[Path, Argument(metavar="MASS", help="Mass matrix in the same format.")],
    nodes: Annotated[
        Path,
        Option(metavar="FILE", help="Input file with the nodes (.inp, .bdf, .dat), result (.frd) or table of nodes."),
    ],
    rows: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="Names of the rows. Default: the .dof (CalculiX) or .mapping (Ansys) next to the matrix.",
        ),
    ] = None,
    group: Annotated[
        list[str] | None,
        Option(metavar="NAME=FILE", help="Own stiffness matrix of a group, such as a panel or a foot. Repeatable."),
    ] = None,
    doubled: Annotated[
        list[str] | None,
        Option(metavar="NAME=FILE", help="Whole stiffness with that of a group doubled. Repeatable."),
    ] = None,
    unit: Annotated[str, one_of("--file-unit", ("m", "mm"), "Units of the files: m, N, kg or mm, N, t.")] = "m",
    out: Annotated[Path, Option("--out", "-o", metavar="FILE", help="File to write.")] = Path("structure.toml"),
    force: Force = False,
) -> int:
    r"""Write a structure file for matrices of another program.

    The matrices go into one .npz file next to it, with groups and the faces of shells and solids. Then edit the
    structure file: members along which masses are sought, sensors and their channels.

    Example:
    modalwatch new external strip.sti strip.mas --nodes strip.inp \
        --doubled root=doubled.sti -o strip.toml
    modalwatch new external kgg.op4 mgg.op4 --nodes model.bdf -o model.toml
    """
    from monitor.cli.new.external_file import write_external
    from updater import ProgramFiles

    files = ProgramFiles(stiffness=stiffness, mass=mass, nodes=nodes, rows=rows, millimetres=unit == "mm")
    return write_external(out, files, groups=group or [], doubled=doubled or [], force=force)
