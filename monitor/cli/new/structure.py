"""Command `new structure`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import KINDS, MATERIALS, Force, one_of


def structure(
    kind: Annotated[str | None, Argument(metavar="|".join(KINDS), help="Kind of structure.")] = None,
    out: Annotated[Path, Option("--out", "-o", metavar="FILE", help="File to write.")] = Path("structure.toml"),
    height: Annotated[float | None, Option(metavar="M", help="Height of a column, post or storey [m].")] = None,
    length: Annotated[float | None, Option(metavar="M", help="Length of a beam between its ends [m].")] = None,
    storeys: Annotated[int | None, Option(metavar="N", help="Number of storeys.", min=1, max=50)] = None,
    section: Annotated[
        str | None,
        Option(
            metavar="SHAPE:DIMENSIONS",
            help="Section of all members [m]: rectangle:WIDTH,HEIGHT; box:WIDTH,HEIGHT,THICKNESS[,RADIUS]; "
            "circle:DIAMETER; tube:DIAMETER,THICKNESS; i:WIDTH,HEIGHT,WEB,FLANGE. WIDTH: along y, HEIGHT: in the "
            "plane of the frame. RADIUS: outer corner radius; default: 2 THICKNESS (cold-formed); 0: sharp corners.",
        ),
    ] = None,
    beam_section: Annotated[
        str | None, Option(metavar="SHAPE:DIMENSIONS", help="Section of beams, if it is another.")
    ] = None,
    material: Annotated[str, one_of("--material", MATERIALS, "Material.")] = "steel",
    sensors: Annotated[
        int,
        Option(
            metavar="N",
            help="Measured places of a member, at equal distances. Posts of storeys: one at each floor.",
            min=1,
            max=20,
        ),
    ] = 2,
    sensors_at: Annotated[
        list[str] | None,
        Option(
            metavar="MEMBER:DISTANCE,..",
            help="Measured places of one member, from its start [m], such as 'left post:0.7,1.4'. Repeatable. Default: "
            "--sensors.",
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None,
        Option(
            metavar="CHANNEL=MEMBER:DISTANCE:AXIS",
            help="Sensor by the name of its channel, member, distance from its start in metres and axis (x, y, z; -x "
            "against it), such as 'A1=left post:0.4:x'. Repeatable, in place of --sensors.",
        ),
    ] = None,
    channels: Annotated[
        Path | None,
        Option(
            metavar="LOG",
            help="Log whose channels are the names of the sensors, in its order: members as the file lists them, along "
            "each member, axis by axis. Default: names of member, place and axis.",
        ),
    ] = None,
    sensor_mass: Annotated[
        float | None,
        Option(
            metavar="KG", help="Mass of the sensor at each measured place, all its axes together [kg]: a body each."
        ),
    ] = None,
    foot_stiffness: Annotated[
        float | None,
        Option(
            metavar="N_M_PER_RAD",
            help="Feet that yield: rotational stiffness about x, y and z [N m/rad], which `diagnose` "
            "fits: a tenth or ten times the true one is near enough.",
        ),
    ] = None,
    pinned: Annotated[
        bool, Option("--pinned", help="Feet that can turn in the plane of the frame. Default: fixed feet.")
    ] = False,
    force: Force = False,
) -> int:
    r"""Write a commented structure file to begin with.

    A terminal prompts for what is not given. Then edit the file: sections, supports, sensors and their
    channels.

    Example:
    modalwatch new structure portal --height 2 --length 3 \
        --section box:0.06,0.04,0.003
    modalwatch new structure portal --height 2 --length 3 \
        --section box:0.06,0.04,0.003 --channels before.mcap
    modalwatch new structure cantilever --height 1 --section circle:0.02 \
        --sensor A1=column:0.5:x --sensor A2=column:1:y
    """
    from monitor.cli.new import structure_file as work

    given = {"height": height, "length": length, "storeys": storeys, "section": section}
    return work.write_structure(
        out,
        kind,
        given,
        beam_section=beam_section,
        material=material,
        sensors=work.places_of(sensors, sensors_at or []),
        listed=sensor or [],
        channels=channels,
        sensor_mass=sensor_mass,
        foot_stiffness=foot_stiffness,
        pinned=pinned,
        force=force,
    )
