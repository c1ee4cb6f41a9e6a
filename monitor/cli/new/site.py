"""Command `new site`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import Force


def site(
    structure: Annotated[Path, Argument(metavar="STRUCTURE.toml", help="Structure file with the sensors.")],
    out: Annotated[Path, Option("--out", "-o", metavar="FILE", help="File to write.")] = Path("site.toml"),
    driver: Annotated[
        str | None, Option(metavar="NAME", help="Driver of the devices; `modalwatch settings` lists the names.")
    ] = None,
    port: Annotated[
        list[str] | None,
        Option(metavar="PORT", help="Serial port of a device, in the order of the places. Repeatable."),
    ] = None,
    can: Annotated[
        str | None,
        Option(metavar="INTERFACE:CHANNEL", help="CAN bus of all devices: slcan:/dev/ttyACM0, socketcan:can0."),
    ] = None,
    rate: Annotated[float, Option(metavar="HZ", help="Sampling rate of the devices [Hz].")] = 1000.0,
    window: Annotated[float, Option(metavar="S", help="Length of a window of analysis [s].")] = 600.0,
    force: Force = False,
) -> int:
    r"""Write a commented SITE.toml for the sensors of a structure.

    One device is assumed at each place of sensors. A terminal prompts for the driver and the ports that are not
    given.

    Example:
    modalwatch new site structure.toml --driver epson-uart \
        --port /dev/ttyUSB0 --port /dev/ttyUSB1
    modalwatch new site structure.toml --driver epson-can \
        --can slcan:/dev/ttyACM0 -o bridge.toml
    """
    from monitor.cli.new.site_file import write_site

    return write_site(out, structure, driver=driver, ports=port or [], can=can, rate=rate, window=window, force=force)
