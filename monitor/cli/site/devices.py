"""Command `devices`."""

from typing import Annotated

from typer import Option

from monitor.cli.options import Force, Json


def devices(
    port: Annotated[
        list[str] | None, Option(metavar="PORT", help="Port to search. Repeatable. Default: all ports.")
    ] = None,
    probe: Annotated[bool, Option("--probe/--no-probe", help="Query devices at the ports.")] = True,
    every: Annotated[bool, Option("--all", help="Also query ports that are not USB.")] = False,
    bitrate: Annotated[
        int, Option(metavar="RATE", help="Bit rate of the bus behind an SLCAN adapter [bit/s].", min=10_000)
    ] = 1_000_000,
    json: Json = None,
    force: Force = False,
) -> int:
    """List ports and devices, with settings to paste.

    Example:
    modalwatch devices
    modalwatch devices --port /dev/ttyUSB0 --json devices.json
    """
    from monitor.cli.output import check_outputs
    from monitor.cli.site.device_search import list_devices

    check_outputs({"--json": json}, force=force)
    return list_devices(port or (), json, probe=probe, every=every, bitrate=bitrate)
