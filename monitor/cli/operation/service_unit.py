"""Site or page of many sites under a service manager: its unit; the health of a site."""

import json
import os
import pwd
from dataclasses import dataclass
from pathlib import Path

import httpx

from monitor.cli.options import DONE, NEEDS_A_PERSON
from monitor.cli.terminal import echo
from monitor.errors import ArgumentError
from monitor.service.servers.web import read_token
from monitor.service.site import Site, load_site
from monitor.service.systemd.unit import Access, Unit, fleet_unit_of, unit_of
from monitor.settings import Settings
from monitor.settings.fleet import load_fleet_settings

_SECONDS = 5.0  # to wait for an answer


def install_unit(path: Path, *, of_user: bool, only_print: bool, run_as: str | None) -> int:
    """Write or print the systemd unit of a site, and print the commands that start it.

    Parameters
    ----------
    of_user : whether it is for the user's manager instead of the system's
    run_as : user that the system's unit runs as. Default: the owner of the site's folder, who must not be root

    Raises
    ------
    SettingsError, StructureError, ArgumentError
        If the site could not run as it is, or the unit cannot be written.
    """
    site = load_site(path.absolute())
    user = _user(site.path, run_as, of_user=of_user)
    writable = (site.state.absolute(), (site.folder / site.settings.recorder.folder).absolute())
    for folder in writable:
        if not folder.is_dir():  # systemd mounts writable folders: they must exist
            folder.mkdir(parents=True)
            if os.geteuid() == 0 and user:
                os.chown(folder, user.uid, user.gid)
    access = Access(
        user=user.name if user else "", writable=tuple(dict.fromkeys(writable)), ports=_ports(site.settings)
    )
    return _install(unit_of(site.path, access, of_user=of_user), of_user=of_user, only_print=only_print)


def install_fleet_unit(path: Path, *, of_user: bool, only_print: bool, run_as: str | None) -> int:
    """Write or print the systemd unit of the page of many sites; parameters as of `install_unit`.

    Raises
    ------
    SettingsError, ArgumentError
        If the page could not be served with these settings, or the unit cannot be written.
    """
    path = path.absolute()
    settings = load_fleet_settings(path)
    user = _user(path, run_as, of_user=of_user)
    writable = ((path.parent / settings.token_file).parent,)  # the token is made at the first start
    access = Access(user=user.name if user else "", writable=writable, ports=())
    return _install(fleet_unit_of(path, access, of_user=of_user), of_user=of_user, only_print=only_print)


def _install(unit: Unit, *, of_user: bool, only_print: bool) -> int:
    if only_print:
        echo(unit.text, nl=False)
        return DONE
    unit.write()
    command = "systemctl --user" if of_user else "systemctl"
    echo(f"written: {unit.path}")
    echo(f"to start it now and at every boot: {command} daemon-reload && {command} enable --now {unit.path.name}")
    if of_user:
        echo("to keep it running while no user is logged in: loginctl enable-linger")
    return DONE


@dataclass(frozen=True)
class _User:
    """User of a service."""

    name: str
    uid: int
    gid: int


def _user(settings: Path, given: str | None, *, of_user: bool) -> _User | None:
    """Return the user of the system's unit: a given one, or the owner of the folder of the settings; else None.

    Raises
    ------
    ArgumentError
        If there is no such user, none is given and the folder is root's, or one is given for the user's manager.
    """
    if of_user:
        if given:
            raise ArgumentError("--as", "expected without --user: your own service manager runs it as you")
        return None
    if given is not None:
        try:
            entry = pwd.getpwnam(given)
        except KeyError as error:
            raise ArgumentError("--as", f"expected a user of this machine, found {given!r}") from error
        return _User(given, entry.pw_uid, entry.pw_gid)
    folder = settings.parent
    owner = folder.stat()
    if owner.st_uid == 0:
        raise ArgumentError(
            "install-service", f"{folder} belongs to root: name the user that the service runs as by --as USER"
        )
    try:
        return _User(pwd.getpwuid(owner.st_uid).pw_name, owner.st_uid, owner.st_gid)
    except KeyError:
        return _User(str(owner.st_uid), owner.st_uid, owner.st_gid)


def _ports(settings: Settings) -> tuple[str, ...]:
    """Return the ports of a site's devices."""
    return tuple(port for d in settings.device if (port := d.port or (d.can.channel if d.can else "")))


def check_health(path: Path) -> int:
    """Query the health of a site's running monitor; 1 with the stale parts if it is not healthy, or does not respond.

    Raises
    ------
    ArgumentError
        If the site has no `[web]` section.
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
        raise ArgumentError("health", f"{site.path} has no [web] section, which `health` requires")
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(web.bind, web.bind)
    token = read_token(site.source.token_path(web.token_file))
    answer = httpx.get(
        f"http://{f'[{host}]' if ':' in host else host}:{web.port}/healthz",
        headers={"Authorization": f"Bearer {token}"},
        timeout=_SECONDS,
        trust_env=False,
    )
    return [str(problem) for problem in json.loads(answer.text)["problems"]]
