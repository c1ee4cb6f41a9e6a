"""Command `log info`."""

from monitor.cli.options import Force, Json, Run


def info(log: Run, json: Json = None, force: Force = False) -> int:
    """Summarize a log.

    Devices, scans, gaps, events, attachments, completeness.

    Example:
    modalwatch log info run.mcap --json info.json
    """
    from monitor.cli.logs.summary import summarize
    from monitor.cli.output import check_outputs

    check_outputs({"--json": json}, force=force)
    return summarize(log, json)
