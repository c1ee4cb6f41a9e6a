"""`install-service` and `health`: a site under a service manager."""

import json
import os
from pathlib import Path

import httpx

from monitor.cli.exits import DONE, NEEDS_A_PERSON
from monitor.cli.terminal import echo
from monitor.errors import ArgumentError
from monitor.site import Site, load_site
from monitor.unit_file import unit_of
from monitor.web import read_token

_SECONDS = 5.0  # to wait for an answer


def install_command(path: Path, *, of_user: bool, only_print: bool) -> int:
    """Write the systemd unit of a site, or print it, and say what starts it.

    Raises
    ------
    SettingsError, StructureError, ArgumentError
        If the site could not run as it is, or the unit cannot be written.
    """
    site = load_site(path.absolute())
    writable = (site.state.absolute(), (site.folder / site.settings.recorder.folder).absolute())
    for folder in writable:
        if not folder.is_dir():  # systemd mounts what may be written to: it must be there
            folder.mkdir(parents=True)
            _give_to_owner(folder, site)
    unit = unit_of(site.path, tuple(dict.fromkeys(writable)), of_user=of_user)
    if only_print:
        echo(unit.text, nl=False)
        return DONE
    unit.write()
    command = "systemctl --user" if of_user else "systemctl"
    echo(f"written: {unit.path}")
    echo(f"to start it now and at every boot: {command} daemon-reload && {command} enable --now {unit.path.name}")
    if of_user:
        echo("to have it run while nobody is logged in: loginctl enable-linger")
    return DONE


def _give_to_owner(folder: Path, site: Site) -> None:
    """Have what the superuser makes belong to the owner of the site's folder, as whom the unit runs."""
    if os.geteuid() == 0:
        owner = site.path.parent.stat()
        os.chown(folder, owner.st_uid, owner.st_gid)


def health_command(path: Path) -> int:
    """Ask a site's running monitor how it is; 1 with what is stale if it is not well, or does not answer.

    Raises
    ------
    ArgumentError
        If the site has no `[web]` section to ask by.
    """
    site = load_site(path)
    try:
        problems = _asked(site)
    except (httpx.HTTPError, OSError, ValueError) as error:
        problems = [f"no answer: {error}"]
    for problem in problems:
        echo(problem)
    return NEEDS_A_PERSON if problems else DONE


def _asked(site: Site) -> list[str]:
    web = site.settings.web
    if web is None:
        raise ArgumentError("health", f"{site.path} has no [web] section to ask by")
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(web.bind, web.bind)
    token = read_token(site.source.token_path(web.token_file))
    answer = httpx.get(
        f"http://{f'[{host}]' if ':' in host else host}:{web.port}/healthz",
        headers={"Authorization": f"Bearer {token}"},
        timeout=_SECONDS,
        trust_env=False,
    )
    return [str(problem) for problem in json.loads(answer.text)["problems"]]
