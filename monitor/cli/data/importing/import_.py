"""Command `import`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DATE_ORDERS, TIME_UNITS, Force, one_of


def import_(
    data: Annotated[
        list[Path],
        Argument(
            metavar="DATA",
            help="A table of text (also .gz, .zip), .npz, .mat, .uff, .h5, .parquet, .arrow, .tdms, .mf4, .mseed, "
            ".wav, or files with dates that follow each other; .log, .blf, .asc, .trc of CAN.",
        ),
    ],
    out: Annotated[Path, Option("--out", "-o", metavar="LOG.mcap", help="Log to write.")],
    rate: Annotated[
        float | None, Option(metavar="HZ", help="Samples per second [Hz], if DATA has no times.", min=1e-6)
    ] = None,
    unit: Annotated[
        str | None,
        Option(
            metavar="UNIT",
            help="Unit of the numbers: m/s2, g, mg, mm/s, um, V, mV, counts, .. Default: that of the column names, "
            "else m/s2.",
        ),
    ] = None,
    scale: Annotated[
        float | None, Option(metavar="FACTOR", help="Factor from numbers to units. Default: 1.", min=1e-12)
    ] = None,
    sensitivity: Annotated[
        str | None,
        Option(metavar="TEXT", help="Sensitivity of the sensors, as '100 mV/g', '28.8 V/(m/s)' or '16384 counts/g'."),
    ] = None,
    calibration: Annotated[
        Path | None,
        Option(metavar="FILE", help="TOML file with unit, sensitivity, scale (negative: sign) and offset per sensor."),
    ] = None,
    start: Annotated[
        str | None, Option(metavar="TIME", help="Time of the first sample, ISO 8601. Default: that of DATA, else 1970.")
    ] = None,
    time: Annotated[
        str | None, Option(metavar="NAME", help="Column of times. Default: t or time (t_ms, time [s]).")
    ] = None,
    time_unit: Annotated[
        str | None, one_of("--time-unit", TIME_UNITS, "Unit of the times. Default: that of the column name, else s.")
    ] = None,
    date_order: Annotated[
        str | None,
        one_of("--date-order", DATE_ORDERS, "Order of dates as 01/02/2026. Default: the only one that is possible."),
    ] = None,
    columns: Annotated[
        str | None,
        Option(
            metavar="NAME,NAME,..",
            help="Names of all columns of a table, for one without names. Empty: the column is left out.",
        ),
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
    high_pass: Annotated[
        float | None,
        Option(metavar="HZ", help="Cut-off of a high-pass filter [Hz]. Default: none.", min=1e-6),
    ] = None,
    resample: Annotated[
        float | None, Option(metavar="HZ", help="Lower sampling rate to convert to [Hz]. Default: none.", min=1e-6)
    ] = None,
    structure: Annotated[Path | None, Option(metavar="FILE", help="structure.toml to attach.")] = None,
    site: Annotated[Path | None, Option(metavar="SITE.toml", help="SITE.toml to attach, with its structure.")] = None,
    new_site: Annotated[
        Path | None,
        Option(metavar="FILE", help="SITE.toml to write for the channels and to attach."),
    ] = None,
    dbc: Annotated[
        Path | None, Option(metavar="FILE", help="DBC file that describes the frames of CAN traffic.")
    ] = None,
    counter: Annotated[str | None, Option(metavar="SIGNAL", help="Signal of CAN traffic that counts scans.")] = None,
    force: Force = False,
) -> int:
    r"""Convert files of measurements to a log.

    One column per channel, named as its sensor.

    Example:
    modalwatch import numbers.txt -o before.mcap --columns t,top_x,top_y \
        --unit mV --sensitivity '100 mV/g'
    modalwatch import logger/*.csv -o days.mcap \
        --structure structure.toml --new-site site.toml
    """
    from daq import DataOptions, read_attachments
    from daq.files import CAN_LOGS, is_table
    from monitor.cli.data.importing.can_traffic import import_can_traffic, one_sensor, site_sensors
    from monitor.cli.data.importing.measurements import columns_of, data_options, import_measurements, start_of
    from monitor.cli.output import check_outputs, replacing
    from monitor.errors import ArgumentError

    if log := next((path for path in data if path.suffix == ".mcap"), None):
        read_attachments(log)  # of another program's, or of none, this is the error
        raise ArgumentError("DATA", f"{log} is a log already: `identify`, `diagnose` and `replay` read it")
    bus = [path for path in data if path.suffix.lower() in CAN_LOGS]
    can = dbc is not None or (bool(bus) and (site is not None or not is_table(bus[0])))  # DASYLab's tables are .asc too
    if can and len(data) > 1:
        raise ArgumentError("DATA", f"expected one file of CAN traffic, found {len(data)}: {data[0]}, {data[1]}")
    described = {"--velocity": velocity, "--unit": unit, "--sensitivity": sensitivity, "--calibration": calibration}
    if can and (given := next((name for name, value in described.items() if value), None)):
        raise ArgumentError(given, "not for a CAN log: its DBC file has it")
    tabular = {"--columns": columns, "--high-pass": high_pass, "--resample": resample}
    if can and (given := next((name for name, value in tabular.items() if value), None)):
        raise ArgumentError(given, "not for a CAN log")
    if can and new_site is not None:
        raise ArgumentError("--new-site", "not of a CAN log, whose sensors [device.dbc] describes: give --site")
    check_outputs({"--new-site": new_site}, force=force)
    if len(data) > 1 and start is not None:
        raise ArgumentError("--start", f"not of {len(data)} files, each with its start date")
    chosen, begin = columns_of(column or ()), None if start is None else start_of(start)
    if can:
        sensors = site_sensors(site) if site else one_sensor(dbc, counter, rate, chosen or {}, scale)
        with replacing(out, force=force):
            return import_can_traffic(data[0], out, sensors, structure, begin)
    others = DataOptions(
        rate=rate,
        factor=scale,
        start=begin,
        time=time,
        time_unit=time_unit,
        date_order=date_order,
        columns=chosen,
        velocities=tuple(velocity or ()),
        temperature=temperature,
        transposed=transpose,
        high_pass=high_pass,
        resample=resample,
    )
    options = data_options(others, unit, sensitivity, columns, calibration)
    with replacing(out, force=force):
        return import_measurements(data, out, options, structure=structure, site=site, new=new_site, force=force)
