"""Command `settings`."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from monitor.cli.options import DONE, Overrides


def settings(
    site: Annotated[
        Path | None, Argument(metavar="SITE.toml", help="SITE.toml. Default: the default settings.")
    ] = None,
    schema: Annotated[bool, Option("--schema", help="Print the JSON Schema of the settings, for editors.")] = False,
    given: Overrides = None,
) -> int:
    """Print all settings as TOML, each with its meaning.

    Example:
    modalwatch settings > site.toml
    modalwatch settings --schema > site.schema.json
    """
    from monitor.cli.terminal import echo
    from monitor.settings import annotated, json_schema, overrides, parse_settings, read_settings

    if schema:
        echo(json_schema())
    elif site is None:
        echo(annotated(), nl=False)
    else:
        text, _ = read_settings(site, overrides(given or ()))
        echo(annotated(parse_settings(text, site)), nl=False)
    return DONE
