"""Command `identify`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import METHODS, From, Json, To, one_of


def identify(
    logs: Annotated[list[Path], Argument(metavar="LOG.mcap...|DIR", help="Logs, or folders of them.")],
    method: Annotated[str, one_of("--method", METHODS, "Identification method.")] = "ssi-data",
    window: Annotated[
        float | None,
        Option(help="Length of a window [s]. Default: that of the log's settings, else the whole log.", min=0.1),
    ] = None,
    band: Annotated[
        tuple[float, float] | None, Option(metavar="LOW HIGH", help="Frequency band of the modes [Hz].")
    ] = None,
    structure: Annotated[
        Path | None,
        Option(metavar="FILE", help="structure.toml to compare with. Default: the one attached to the log."),
    ] = None,
    reference: Annotated[
        list[str] | None,
        Option(
            metavar="NAME",
            help="Reference sensor of set-ups: it stays in place, and each log is one set-up. Repeatable.",
        ),
    ] = None,
    start: From = None,
    stop: To = None,
    json: Json = None,
    picture: Annotated[
        Path | None,
        Option(metavar="PICTURE.png", help="Picture to write: spectrum, stabilization diagram, mode shapes."),
    ] = None,
    out: Annotated[
        Path | None, Option(metavar="DIR", help="Folder for modes.json, modes.unv (UFF 55) and pictures.")
    ] = None,
) -> int:
    """Identify the modes of logs.

    One estimate with its uncertainty, averaged over all windows. All logs count as one record for
    --from and --to; with --reference each log separately.

    Example:
    modalwatch identify measured.mcap --band 1 20 --picture modes.png
    modalwatch identify setup_1.mcap setup_2.mcap --reference top_x --out modes
    """
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.identify.identification import identify_logs

    return identify_logs(
        logs,
        method=method,
        window=window,
        band=band,
        structure=structure,
        references=reference or (),
        within=time_range(start, stop),
        json_path=json,
        picture=picture,
        out=out,
    )
