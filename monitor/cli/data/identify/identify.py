"""Command `identify`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import ANIMATIONS, DONE, METHODS, ExponentialWindow, Force, From, Json, To, one_of


def identify(
    logs: Annotated[
        list[Path],
        Argument(
            metavar="LOG.mcap...|DIR", help="Logs, folders of them, or one file of frequency responses (.uff, .unv)."
        ),
    ],
    method: Annotated[str, one_of("--method", METHODS, "Identification method.")] = "ssi-data",
    window: Annotated[
        float | None,
        Option(
            metavar="S",
            help="Length of a window [s]. Default: that of the log's settings, else the whole log.",
            min=0.1,
        ),
    ] = None,
    band: Annotated[
        tuple[float, float] | None, Option(metavar="LOW HIGH", help="Frequency band of the modes [Hz].")
    ] = None,
    structure: Annotated[
        Path | None,
        Option(metavar="FILE", help="structure.toml to compare with. Default: that of the site."),
    ] = None,
    site: Annotated[
        Path | None,
        Option(
            metavar="SITE.toml",
            help="Window, band, structure, or positions of sensors. Default: attached to the log.",
        ),
    ] = None,
    reference: Annotated[
        list[str] | None,
        Option(
            "--reference-sensor",
            metavar="NAME",
            help="Reference sensor of set-ups: it stays in place, and each log is one set-up. Repeatable.",
        ),
    ] = None,
    amplitude: Annotated[
        bool, Option("--amplitude", help="Test whether frequencies and damping depend on the amplitude.")
    ] = False,
    exponential_window: ExponentialWindow = None,
    start: From = None,
    stop: To = None,
    json: Json = None,
    picture: Annotated[
        Path | None,
        Option(metavar="PICTURE.png", help="Picture to write: spectrum, stabilization diagram, mode shapes."),
    ] = None,
    animate: Annotated[
        Path | None,
        Option(metavar="FILE", help="Mode shapes in motion: an .html page that can be turned, or a .gif."),
    ] = None,
    out: Annotated[
        Path | None,
        Option("--out", "-o", metavar="DIR", help="Folder for modes.json, modes.unv (UFF 55) and pictures."),
    ] = None,
    force: Force = False,
) -> int:
    """Identify the modes of logs, or of frequency responses.

    One estimate with its uncertainty, averaged over all windows. All logs count as one record for
    --from and --to; with --reference-sensor each log separately.

    Example:
    modalwatch identify measured.mcap --band 1 20 --picture modes.png
    modalwatch identify setup_1.mcap setup_2.mcap --reference-sensor top_x
    modalwatch identify hammer.uff --out modes
    """
    import numpy as np

    from monitor.analysis.modal_table.universal import is_universal
    from monitor.analysis.states.stationarity import frequency_change
    from monitor.analysis.time_range import time_range
    from monitor.cli.data.identify import identification as work
    from monitor.cli.data.identify.amplitude_output import say_dependence
    from monitor.cli.data.identify.identification_output import Findings, as_json, say_modes
    from monitor.cli.output import check_outputs, existing_in, write_json
    from monitor.cli.terminal import progress
    from monitor.errors import ArgumentError
    from oma import METHODS as IMPLEMENTED

    if band is not None and not 0 < band[0] < band[1]:
        raise ArgumentError("--band", f"expected 0 < low < high, found {band[0]:g} {band[1]:g}")
    if animate and animate.suffix.lower() not in ANIMATIONS:
        raise ArgumentError("--animate", f"expected a name that ends with {' or '.join(ANIMATIONS)}, found {animate}")
    in_folder = existing_in(out, work.FOLDER_FILES)
    check_outputs({"--json": json, "--picture": picture, "--animate": animate, "--out": in_folder}, force=force)
    if any(map(is_universal, logs)):
        from monitor.cli.data.identify.response_modes import ResponseRequest, identify_response_file  # slow to import

        of_logs = {"--site": site, "--window": window, "--reference-sensor": reference, "--from": start, "--to": stop}
        of_logs["--amplitude"] = amplitude
        request = ResponseRequest(
            paths=logs,
            of_logs={name for name, value in of_logs.items() if value},
            band=band,
            window=exponential_window,
            structure=structure,
            json=json,
            picture=picture,
            animate=animate,
            out=out,
        )
        return identify_response_file(request)
    if exponential_window is not None:
        raise ArgumentError("--exponential-window", f"expected frequency responses (.uff, .unv), found {logs[0]}")
    setups = bool(reference)
    if setups and amplitude:
        raise ArgumentError("--amplitude", "expected logs of one set-up, found --reference-sensor")
    found = work.logs_within(logs, time_range(start, stop), setups=setups)
    given = work.attached(found[0], site)
    settings = given.settings
    window = window or (settings.analysis.window_seconds if settings else None)
    band = band or (settings.analysis.band if settings else None)
    chosen = IMPLEMENTED[method]()
    recordings = work.LogWindows(found[:1] if setups else found, window)
    if reference:
        windows, fused = work.merged(found, window, chosen, band, reference)
    else:
        windows, fused = work.identified(found, recordings, chosen, band)
    with progress("comparing"):
        model = work.modes_of_structure(fused.estimate, given, structure)
        shown = Findings(
            windows=windows,
            fused=fused,
            partners=[model.partner(i) if model else None for i in range(fused.estimate.n_modes)],
            nearest={i: model.nearest(i) for i in np.flatnonzero(model.pairs < 0).tolist()} if model else {},
            asynchrony=None if setups else work.channel_delays(recordings, windows, fused.estimate),
            change=None if setups else frequency_change(windows, lambda: recordings, chosen, band),
            amplitude=work.amplitude_dependences(recordings, windows, fused.estimate) if amplitude else None,
            exchanged=work.exchanged_in(model, fused.estimate, windows.rate),
        )
    geometry = work.sensor_positions(fused.estimate, given, site)
    say_modes(found, shown, setups=setups)
    if shown.amplitude is not None:
        say_dependence(fused.estimate, shown.amplitude)
    about = {"name": method, "windows": len(windows.estimates), "window_seconds": window, "band": band}
    content = as_json(shown) | {"method": about | {"options": asdict(chosen)}}
    if json:
        write_json(json, content)
    with progress("drawing"):
        if animate:
            work.animate_modes(animate, fused.estimate, model, geometry)
        if picture or out:
            first = work.first_window(recordings, chosen, band)
        if picture:
            work.draw_window(picture, *first, fused.estimate)
        if out:
            estimates = () if setups else windows.estimates
            work.fill_folder(out, estimates, fused.estimate, *first, model, geometry, content)
    return DONE
