"""Output of `structure`: tables, sentences and JSON."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from daq import FloatArray, IndexArray
from monitor.analysis.channels import ChannelCheck, twins
from monitor.cli.terminal import new_table
from monitor.text.quantities import duration_words, mass_words, stretches_text
from updater import Structure
from updater.planning import DetectabilityStudy, ModeVisibility, Plan, SensorSet, blind, clearer, mean_position_std
from updater.structure import Sensor

_MEMBERS = 12  # more of them are not all listed: those where least and where most mass is needed
_WHOLE = 10.0  # mm: larger deviations are stated in whole millimetres
_PAIRS = 4  # that are named
_WORTH_IT = 0.9  # of how far off a mass is located, that one more sensor must come under
_SHARES = (0.5, 0.8, 0.9, 0.95)  # of the members' length, in the columns of sensor sets


def modes_table(sight: ModeVisibility) -> Table:
    """Return the modes and their visibility by the sensors."""
    structure = sight.model.structure
    names = ("mode", "frequency\n[Hz]", "measured\nby sensors", "best sensor", "similar\nshapes")
    table = new_table(right=names, no_wrap=True, title=structure.name)
    for k, frequency in enumerate(sight.modes.frequency):
        best = structure.channels[int(np.argmax(np.abs(sight.at_sensors[k])))] if structure.channels else "-"
        alike = ", ".join(str(other + 1) for other in sight.alike(k)) or "none"
        seen = f"{100 * sight.seen[k]:.0f} %" if sight.is_seen(k) else "no"
        table.add_row(str(k + 1), f"{frequency:.3f}", seen, escape(best), alike)
    return table


def clearer_words(sight: ModeVisibility) -> Iterator[str]:
    """Return texts on unmeasured and similar modes, and on the best additional sensor."""
    if sight.unseen:
        yield f"no sensor measures {_modes(sight.unseen)}"
    if sight.pairs_alike:
        yield "not distinguishable by shape: " + _pairs(sight.pairs_alike)
    better = clearer(sight)
    if better is None:
        return
    sensor, then = better
    shown = sorted(set(sight.unseen) - set(then.unseen))
    separated = sorted(set(sight.pairs_alike) - set(then.pairs_alike))
    gains = [f"shows {_modes(shown)}"] if shown else []
    gains += ["distinguishes " + _pairs(separated)] if separated else []
    then_alike = sorted(set(then.pairs_alike) - set(sight.pairs_alike))
    if gains and then_alike:
        gains.append("but does not distinguish " + _pairs(then_alike))
    if gains:
        yield f"a sensor at {_at(sensor)} {', '.join(gains)}"


def channel_words(structure: Structure, check: ChannelCheck | None) -> Iterator[str]:
    """Return texts on duplicate sensors, and on sensors and channels without a counterpart."""
    for one, other in twins(structure):
        yield f"{one} and {other} measure the same motion"
    if check is None:
        return
    if check.good:
        yield f"{check.path}: its {check.n_channels} channels are the structure's sensors"
    if check.without_sensor:
        yield f"{check.path}: no sensor of the structure for {', '.join(check.without_sensor)}"
    if check.without_channel:
        yield f"{check.path}: no channel for {', '.join(check.without_channel)}, left out above"


def _modes(numbers: tuple[int, ...] | list[int]) -> str:
    return f"mode{'s' * (len(numbers) > 1)} " + ", ".join(str(k + 1) for k in numbers)


def _pairs(pairs: Sequence[tuple[int, int]]) -> str:
    """Name some pairs of modes, or count many."""
    if len(pairs) > _PAIRS:
        return f"{len(pairs)} pairs"
    return ", ".join(f"{a + 1} and {b + 1}" for a, b in pairs)


def _at(sensor: Sensor) -> str:
    x, y, z = sensor.at
    along = "xyz"[int(np.argmax(np.abs(sensor.direction)))]
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m along {along}"


def body_table(sight: ModeVisibility, outlook: DetectabilityStudy) -> Table:
    """Return, member by member, the weakest mass that raises the alarm, and how sure a body's place will be."""
    mass, record = sight.typical_mass, outlook.record
    title = (
        f"Added mass: {duration_words(record.seconds)} before and after, damping {100 * record.damping:g} %, "
        f"{len(outlook.frequency)} modes up to {record.highest:g} Hz"
    )
    located = f"{mass_words(mass)}, 1 % of the structure,\nlocated to ±, median"
    names = ("smallest detectable", "at [m]", "median over the member", located)
    table = new_table(("member",), names, title=title)
    table.add_column(escape("not detectable\nfrom .. to [m]"), no_wrap=True)
    place, _ = outlook.bound(mass)
    members = outlook.reference.structure.member
    median = [float(np.median(sight.weakest[outlook.member == m])) for m in range(len(members))]
    shown = np.arange(len(members)) if len(members) <= _MEMBERS else _ends(np.argsort(median, kind="stable"))
    for m, member in ((int(m), members[m]) for m in shown):
        here = np.flatnonzero(outlook.member == m)
        least = here[np.argmin(sight.weakest[here])]
        unseen = stretches_text(blind(outlook, sight.weakest.tolist(), m)) or "none"
        if not np.isfinite(sight.weakest[least]):  # held at both ends: no mode moves it
            table.add_row(escape(member.name), "none", "-", "none", "none", unseen)
            continue
        table.add_row(
            escape(member.name),
            mass_words(float(sight.weakest[least])),
            f"{outlook.places.position[least]:.2f}",
            mass_words(median[m]) if np.isfinite(median[m]) else "none",
            _millimetres(1000 * float(np.median(place[here]))),
            unseen,
        )
    return table


def _millimetres(std: float) -> str:
    """Return a deviation [mm] in whole millimetres, or with two digits if it is below ten."""
    return f"{std:.2g} mm" if std < _WHOLE else f"{std:.0f} mm"


def _ends(order: IndexArray) -> IndexArray:
    """Return the first and the last of an order."""
    return np.concatenate([order[: _MEMBERS // 2], order[-(_MEMBERS // 2) :]])


def helper_words(sight: ModeVisibility) -> str:
    """Return a text on the best additional sensor."""
    if sight.helper is None or sight.outlook is None:
        return ""
    before = mean_position_std(sight.outlook, sight.typical_mass)
    after, mass = sight.helper.mean_position_std, mass_words(sight.typical_mass)
    found = f"{mass} located to ± {1000 * after:.3g} mm instead of {1000 * before:.3g} mm"
    mean = "geometric mean over all places of all members, those near supports included"
    if after > _WORTH_IT * before:
        return f"an additional sensor improves this only slightly: {found} at best ({mean})"
    return f"best place of an additional sensor: {_at(sight.helper.changed)}: {found} ({mean})"


def plan_tables(planned: Plan) -> Iterator[RenderableType]:
    """Return how long a record must be, place by place and for other numbers of sensors."""
    target = planned.target
    what = f"{mass_words(target.mass)} found within {1000 * target.within:g} mm in {100 * target.chance:g} of 100 cases"
    names = ("record before and after", "share of the members' length")
    table = new_table(right=names, title=f"{what}, alarm included")
    shares = [planned.present.share_found(float(s)) for s in planned.records]
    for k, (seconds, share) in enumerate(zip(planned.records, shares, strict=True)):
        if k in (0, len(shares) - 1) or share > shares[k - 1]:
            table.add_row(duration_words(float(seconds)), f"{100 * share:.0f} %")
    yield table
    parts = (f"{100 * share:g} % of the length" for share in _SHARES)
    table = new_table(right=("sensors", *parts), title="Record needed, by sensors")
    for sensors in (planned.more, planned.present, *planned.fewer):
        needed = [sensors.seconds_for(share) for share in _SHARES]
        cells = (duration_words(seconds) if np.isfinite(seconds) else "-" for seconds in needed)
        table.add_row(str(len(sensors.channels)), *cells)
    yield table
    more = Sensor(channel="new", at=planned.more_at, direction=planned.more_along)
    yield Text(f"{len(planned.more.channels)} sensors: with an additional one at {_at(more)}")
    if planned.left_out:
        yield Text("fewer sensors: removed in this order " + ", ".join(planned.left_out))


def as_json(sight: ModeVisibility, planned: Plan | None) -> dict[str, Any]:
    """Return all figures; null where no sensor measures a mode or no mass is enough."""
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


def _body(sight: ModeVisibility, outlook: DetectabilityStudy) -> dict[str, Any]:
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
            "position_std": {
                "before": mean_position_std(outlook, sight.typical_mass),
                "after": helper.mean_position_std,
            },
        },
    }


def _places(outlook: DetectabilityStudy, rows: IndexArray) -> list[dict[str, Any]]:
    names = [member.name for member in outlook.reference.structure.member]
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
