"""`settings`: all settings with their meaning, and their JSON Schema."""

from collections.abc import Sequence
from pathlib import Path

from monitor.cli.exit_codes import DONE
from monitor.cli.terminal import echo
from monitor.settings import annotated, json_schema, overrides, parse_settings, read_settings


def settings_command(site: Path | None, given: Sequence[str], *, schema: bool) -> int:
    """Print the defaults, the resulting settings of a site, or the JSON Schema.

    Raises
    ------
    SettingsError, ArgumentError
        If the settings of the site, or the overriding values, are invalid.
    """
    if schema:
        echo(json_schema())
    elif site is None:
        echo(annotated(), nl=False)
    else:
        text, _ = read_settings(site, overrides(given))
        echo(annotated(parse_settings(text, site)), nl=False)
    return DONE
