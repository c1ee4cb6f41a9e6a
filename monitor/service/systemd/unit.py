"""The systemd units of a site and of the page of many sites: started at boot, and allowed no more than they need.

References
----------
systemd.service(5), systemd.exec(5), systemd.resource-control(5).
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

from monitor.errors import ArgumentError

_MARK = "# Written by `modalwatch install-service`; a second time writes it anew."
_SYSTEM = Path("/etc/systemd/system")

_COMMON = """\
NoNewPrivileges=yes
LockPersonality=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
RestrictNamespaces=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM
UMask=0027
MemoryMax=80%
"""
#: restrictions that only the system's manager can apply; @resources stays, as processes lower their priority
_OF_SYSTEM = """\
SystemCallFilter=~@privileged
CapabilityBoundingSet=
ProtectSystem=strict
ProtectHome=read-only
PrivateTmp=yes
PrivateMounts=yes
ProtectClock=yes
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
ProtectHostname=yes
ProtectProc=invisible
ProcSubset=pid
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_CAN AF_NETLINK
DevicePolicy=closed
"""
#: beginnings of ports -> kinds of devices there; whole kinds, as a device that is plugged in again gets another number
_KINDS = {
    "/dev/serial/": ("char-ttyUSB", "char-ttyACM"),
    "/dev/ttyUSB": ("char-ttyUSB",),
    "/dev/ttyACM": ("char-ttyACM",),
    "/dev/ttyS": ("char-ttyS",),
    "/dev/pts/": ("char-pts",),
}


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit file."""

    path: Path
    text: str

    def write(self) -> None:
        """Write it; never over a file of other origin.

        Raises
        ------
        ArgumentError
            If it cannot be written, or another file is there.
        """
        try:
            if self.path.exists() and _MARK not in self.path.read_text(encoding="utf-8"):
                raise ArgumentError("install-service", f"{self.path} is there already, and not written by this program")
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(self.text, encoding="utf-8")
        except OSError as error:
            raise ArgumentError("install-service", f"{self.path}: {error.strerror}; --print shows it") from error


@dataclass(frozen=True, kw_only=True)
class Access:
    """Resources that a unit may use in addition to the files that it may read."""

    user: str  #: user of the service; not used by the user's manager
    writable: tuple[Path, ...]  #: folders, absolute
    ports: tuple[str, ...]  #: ports of devices: files below /dev, or others


def unit_of(site: Path, access: Access, *, of_user: bool) -> Unit:
    """Return the unit that runs a site.

    Parameters
    ----------
    site : SITE.toml, absolute
    access : permitted to the run
    of_user : whether it is for the user's manager instead of the system's
    """
    of_site = ["ExecReload=/bin/kill -HUP $MAINPID", "WatchdogSec=60", "TimeoutStartSec=120", "TimeoutStopSec=90"]
    return _unit(site, "run", "watches", of_site, access, of_user=of_user)


def fleet_unit_of(fleet: Path, access: Access, *, of_user: bool) -> Unit:
    """Return the unit that serves the page of many sites; parameters as of `unit_of`, with FLEET.toml."""
    return _unit(fleet, "fleet", "serves the page of", ["TimeoutStopSec=30"], access, of_user=of_user)


def _unit(path: Path, command: str, does: str, of_service: list[str], access: Access, *, of_user: bool) -> Unit:
    name = "modalwatch-" + re.sub(r"[^A-Za-z0-9]+", "-", path.parent.name + "-" + path.stem).strip("-")
    folder = Path.home() / ".config" / "systemd" / "user" if of_user else _SYSTEM
    lines = [_MARK, "[Unit]", f"Description=modalwatch {does} {_plain(path.parent.name)}/{_plain(path.name)}"]
    if not of_user:
        lines += ["Wants=network-online.target", "After=network-online.target time-sync.target"]
    lines += ["StartLimitIntervalSec=0", "", "[Service]", "Type=notify", "NotifyAccess=main"]
    lines += [f"ExecStart={_command()} {command} {_quoted(path)}", f"WorkingDirectory={_plain(path.parent)}"]
    lines += of_service
    lines += ["# settings that are wrong stay wrong: 2 is not tried again, what could not start (3) is"]
    lines += [
        "Restart=on-failure",
        "RestartSec=5",
        "RestartPreventExitStatus=2",
        "KillMode=mixed",
        "OOMPolicy=continue",
    ]
    lines += ["Environment=OPENBLAS_NUM_THREADS=1", "", "# no more than it needs", *_COMMON.splitlines()]
    if not of_user:
        lines += [f"User={_plain(access.user)}", *_OF_SYSTEM.splitlines(), *_devices(access.ports)]
        lines += [f"ReadWritePaths={_quoted(folder)}" for folder in access.writable]
    lines += ["", "[Install]", f"WantedBy={'default' if of_user else 'multi-user'}.target"]
    return Unit(path=folder / f"{name}.service", text="\n".join(lines) + "\n")


def _command() -> str:
    """Return the command installed with this interpreter."""
    script = Path(sys.executable).parent / "modalwatch"
    if script.exists():
        return _quoted(script)
    return f'{_quoted(Path(sys.executable))} -c "from monitor.cli.main import main; main()"'


def _devices(ports: tuple[str, ...]) -> list[str]:
    """Return the devices of a site's ports; without ports there is none.

    PrivateDevices= is for sites without ports only: a port that is plugged in again would not appear.
    """
    files = {name for port in ports for name in (port, str(Path(port).resolve())) if name.startswith("/dev/")}
    if not files:
        return ["PrivateDevices=yes"]
    kinds = {k for f in files for k in next((k for begin, k in _KINDS.items() if f.startswith(begin)), (f,))}
    return [*(f"DeviceAllow={_plain(kind)} rw" for kind in sorted(kinds)), "SupplementaryGroups=dialout"]


def _plain(value: object) -> str:
    """Return text with the signs that begin a specifier doubled."""
    return str(value).replace("%", "%%")


def _quoted(path: Path) -> str:
    escaped = _plain(path).replace("\\", "\\\\").replace('"', '\\"').replace("$", "$$")
    return f'"{escaped}"'
