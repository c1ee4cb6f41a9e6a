"""Output of `structure --json` for other programs."""

from typing import Any

import numpy as np

from daq import FloatArray, IndexArray
from monitor.sight import Sight
from monitor.target import Plan, SensorSet
from updater import Outlook, vagueness


def as_json(sight: Sight, planned: Plan | None) -> dict[str, Any]:
    """Return all figures; null where no sensor sees a mode or no mass is enough."""
    n = len(sight.modes.frequency)
    return {
        "name": sight.model.structure.name,
        "total_mass": sight.model.total_mass(),
        "channels": list(sight.model.structure.channels),
        "frequencies": sight.modes.frequency.tolist(),
        "seen": sight.seen.tolist(),
        "auto_mac": [[None if np.isnan(v) else v for v in row] for row in sight.auto_mac.tolist()],
        "alike": [[k + 1 for k in sight.alike(mode)] for mode in range(n)],
        "body": _body(sight, sight.outlook) if sight.outlook else None,
        "target": _target(planned) if planned else None,
    }


def _body(sight: Sight, outlook: Outlook) -> dict[str, Any]:
    place, mass = outlook.bound(sight.typical_mass)
    helper = sight.helper
    return {
        "record": outlook.record.seconds,
        "damping": outlook.record.damping,
        "modes": outlook.frequency.tolist(),
        "typical_mass": sight.typical_mass,
        "places": _places(outlook, np.arange(len(outlook.member))),
        "weakest_mass": _finite(sight.weakest),
        "position_std": place.tolist(),
        "mass_std": mass.tolist(),
        "one_more": helper
        and {
            "at": list(helper.changed.at),
            "direction": list(helper.changed.direction),
            "position_std": {"before": vagueness(outlook, sight.typical_mass), "after": helper.vagueness},
        },
    }


def _places(outlook: Outlook, rows: IndexArray) -> list[dict[str, Any]]:
    names = [member.name for member in outlook.reference.calibration.structure.member]
    return [{"member": names[outlook.member[k]], "position": outlook.point[k].tolist()} for k in rows]


def _target(planned: Plan) -> dict[str, Any]:
    target = planned.target
    sets = [planned.present, *planned.fewer]
    return {
        "mass": target.mass,
        "within": target.within,
        "chance": target.chance,
        "places": _places(planned.outlook, planned.present.places),
        "seconds": _finite(planned.present.seconds),
        "records": [
            {"seconds": float(s), "share": planned.present.share_found(float(s))} for s in planned.records.tolist()
        ],
        "sensors": [_set(sensors) for sensors in sets],
        "one_more": _set(planned.more) | {"at": list(planned.more_at), "direction": list(planned.more_along)},
    }


def _set(sensors: SensorSet) -> dict[str, Any]:
    needed = {str(share): _finite(np.array([sensors.seconds_for(share)]))[0] for share in (0.5, 0.8, 0.9, 0.95)}
    return {"channels": list(sensors.channels), "seconds_for_share": needed}


def _finite(values: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
