"""Command `import`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import TIME_UNITS, one_of


def import_(
    data: Annotated[
        list[Path],
        Argument(
            metavar="DATA",
            help="A table (CSV), .npz, .mat, .uff, .unv, or tables with dates that follow each other; "
            ".log, .blf, .asc, .trc of CAN.",
        ),
    ],
    out: Annotated[Path, Option("--out", "-o", metavar="LOG.mcap", help="Log to write.")],
    rate: Annotated[float | None, Option(help="Samples per second [Hz], if DATA has no times.", min=1e-6)] = None,
    unit: Annotated[
        str | None,
        Option(help="Unit of the numbers: m/s2, mm/s2, g, mg. Default: that of the column names, else m/s2."),
    ] = None,
    scale: Annotated[float | None, Option(help="Factor from numbers to units. Default: 1.", min=1e-12)] = None,
    start: Annotated[
        str | None, Option(help="Time of the first sample, ISO 8601. Default: that of DATA, else 1970.")
    ] = None,
    time: Annotated[
        str | None, Option(metavar="NAME", help="Column of times. Default: t or time (t_ms, time [s]).")
    ] = None,
    time_unit: Annotated[
        str | None, one_of("--time-unit", TIME_UNITS, "Unit of the times. Default: that of the column name, else s.")
    ] = None,
    column: Annotated[
        list[str] | None,
        Option(metavar="NAME[=SENSOR]", help="Column to import, and its sensor. Repeatable. Default: all columns."),
    ] = None,
    velocity: Annotated[
        list[str] | None, Option(metavar="SENSOR", help="Sensor that measures velocity [m/s]. Repeatable.")
    ] = None,
    temperature: Annotated[
        str | None, Option(metavar="NAME", help="Column of temperatures. Default: columns with a unit of temperature.")
    ] = None,
    transpose: Annotated[
        bool | None,
        Option(
            "--transpose/--no-transpose",
            help="Rows of an array are channels (or columns are). Required where the shape is ambiguous.",
        ),
    ] = None,
    structure: Annotated[Path | None, Option(metavar="FILE", help="structure.toml to attach.")] = None,
    site: Annotated[Path | None, Option(metavar="FILE", help="SITE.toml to attach, with its structure.")] = None,
    new_site: Annotated[
        Path | None,
        Option(metavar="FILE", help="SITE.toml to write for the channels and to attach. Requires --structure."),
    ] = None,
    dbc: Annotated[
        Path | None, Option(metavar="FILE", help="DBC file that describes the frames of CAN traffic.")
    ] = None,
    counter: Annotated[str | None, Option(metavar="SIGNAL", help="Signal of CAN traffic that counts scans.")] = None,
) -> int:
    """Convert files of measurements to a log.

    One column per channel, named as its sensor.

    Example:
    modalwatch import before.csv -o before.mcap --unit g
    modalwatch import logger/*.csv -o days.mcap --structure structure.toml --new-site site.toml
    """
    from daq import DataOptions
    from daq.files import CAN_LOGS
    from monitor.cli.data.importing.can_traffic import import_can_traffic, one_sensor, site_sensors
    from monitor.cli.data.importing.measurements import columns_of, factor_of, import_measurements, start_of
    from monitor.errors import ArgumentError

    can = dbc is not None or any(path.suffix.lower() in CAN_LOGS for path in data)
    if can and len(data) > 1:
        raise ArgumentError("DATA", f"expected one file of CAN traffic, found {len(data)}: {data[0]}, {data[1]}")
    if can and (velocity or unit is not None):
        raise ArgumentError("--velocity" if velocity else "--unit", "not for a CAN log: its DBC file has it")
    if can and new_site is not None:
        raise ArgumentError("--new-site", "not of a CAN log, whose sensors [device.dbc] describes: give --site")
    if len(data) > 1 and start is not None:
        raise ArgumentError("--start", f"not of {len(data)} files, each with its start date")
    columns, begin = columns_of(column or ()), None if start is None else start_of(start)
    if can:
        sensors = site_sensors(site) if site else one_sensor(dbc, counter, rate, columns or {}, scale)
        return import_can_traffic(data[0], out, sensors, structure, begin)
    options = DataOptions(
        rate=rate,
        factor=factor_of(unit, scale),
        start=begin,
        time=time,
        time_unit=time_unit,
        columns=columns,
        velocities=tuple(velocity or ()),
        temperature=temperature,
        transposed=transpose,
    )
    return import_measurements(data, out, options, structure=structure, site=site, new=new_site)
