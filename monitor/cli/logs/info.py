"""Command `log info`."""

from monitor.cli.options import Json, Run


def info(log: Run, json: Json = None) -> int:
    """Summarize a log.

    Devices, scans, gaps, events, attachments, completeness.

    Example:
    modalwatch log info run.mcap --json info.json
    """
    from monitor.cli.logs.summary import summarize

    return summarize(log, json)
