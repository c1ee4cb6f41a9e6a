"""Findings in sentences: shared by the loop, the report, the viewer and the terminal."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from daq.notebook import number_text, rounded_text
from monitor.results.comparison import BalanceResult, DiscrepancyResult, SensorComparison
from monitor.results.windows import IncrementPlace, MassAnswer, MassIncrements, OtherPlace
from monitor.text.cause_list import listed_causes
from monitor.text.quantities import MIN_P, counted, share_text
from updater import Cause, Diagnosis, Gain
from updater.diagnosis import CalibrationSummary, Failed, FittedCause, OtherStiffness, Pair
from updater.quantities import (
    ECCENTRIC,
    FREQUENCY_STD,
    ONE_SIDED_95,
    Breathing,
    Law,
    NonlinearGain,
    ParameterChange,
    Quantity,
    Vector,
    Where,
    plain,
)

if TYPE_CHECKING:
    from updater.localization import AccuracyForecast

_SPOKEN = {"m": (1000.0, "mm"), "s": (1000.0, "ms"), "rad": (180 / math.pi, "degrees"), "1/K": (100.0, "%/K")}
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (0.0, ""))  # of forces and stiffness
_FINE_PREFIXES = ((1e-1, 1.0, ""), (1e-4, 1e3, "m"), (1e-7, 1e6, "µ"), (0.0, 1e9, "n"))  # of flexibilities per kN
_OPEN = 0.5  # standard deviation of a stiffness over itself: from there on it may be infinite
_BY_MODES = "decided by the signals: by the modes alone, another cause or no change is more probable"
_LAWS: dict[Law, str] = {
    "one_side": "it opens and closes",
    "within": "it has play, which is taken up beyond a moment or force on both sides",
    "beyond": "it opens or slips beyond a moment or force on both sides",
}
_CONSTANT = 0.3  # upper bound of the share of a flexibility that closes, below which it is stated not to
_LOSSES = ("loss_about_local_y", "loss_about_local_z", "loss_in_twist")  # which "loss", the most of them, only repeats
_LOSS_NAMES = frozenset({"loss", *_LOSSES})
_SHARES = _LOSS_NAMES | {"error", "damping"}  # parameters without a unit that are given in per cent
_COARSE, _METRES = 5e-4, 1.0  # m of a place's deviation: limit of whole mm, limit of m
_WARMER = "warmer"  # parameter of a change of temperature [K]
_OFFSET = "offset_"  # parameters of a body that are shown if significant
_MANY, _FEW = 6, 3  # parameters of a cause: above so many, so many are given in a line
_MAX_NAMED = 4  # places that are named; more are counted if all are of one kind, ...
_FEW_NAMED = 3  # ... else so many are named
_SAME_ERROR = 0.02  # relative difference of errors of frequencies that are those of the same prediction
_LARGE = 10.0  # kg: smaller masses are given in grams
CLEAR_ODDS = 5.0  #: log evidence above which only one interpretation of the residual forces is shown
SIGNIFICANT = 3.0  #: standard deviations from which a peak of them is named
_INSIGNIFICANT = 2.0  # standard deviations within which a change of stiffness is called not significant
_SURE = 3.0  # standard deviations from which the difference of a fitted parameter from the file is certain


def fit_text(answer: MassAnswer) -> str:
    """Return the quality of the fit of a mass, and the number of windows."""
    p = f"= {answer.p_value:.2g}" if answer.p_value > MIN_P else f"< {MIN_P:.0e}"
    return f"fit p {p} from {answer.n_windows} window{'s' * (answer.n_windows > 1)}"


def quantity_text(quantity: Quantity) -> str:
    """Return a parameter with its standard deviation and unit; masses in grams unless large."""
    scale, unit = (1.0, quantity.unit) if quantity.unit != "-" else (1.0, "")
    if unit == "kg" and abs(quantity.value) < _LARGE:
        scale, unit = 1000.0, "g"
    return f"{number_text(scale * quantity.value, scale * quantity.std)} {unit}".rstrip()


def parameter_text(name: str, quantity: Quantity) -> str:
    """Return a cause's parameter in the unit that is spoken: lengths in mm, delays in ms, angles in degrees.

    A gain and a factor are numbers; a share is a loss or an error. The name of a temperature change, and of a loss, has
    its sign.
    """
    if (name == _WARMER or name in _LOSS_NAMES) and quantity.value < 0:
        quantity = quantity.model_copy(update={"value": -quantity.value})
    scale, unit = _SPOKEN.get(quantity.unit, (1.0, ""))
    if quantity.unit.startswith("N"):
        size, prefix = next(pair for pair in _PREFIXES if abs(quantity.value) >= pair[0])
        scale, unit = 1 / (size or 1.0), prefix + quantity.unit
    if quantity.unit == "-" and name in _SHARES:
        scale, unit = 100.0, "%"
    if not unit or (quantity.unit == "m" and abs(quantity.value) >= 1.0):
        return quantity_text(quantity)
    return f"{number_text(scale * quantity.value, scale * quantity.std)} {unit}"


def where_text(where: Where | None) -> str:
    """Return the place of a cause by the structure's names and its position; empty for one that has none."""
    if where is None:
        return ""
    named = at_place(where.name)
    parts = [f"on the {where.member}"] if where.member else [f"{named},"] if named else []
    std = where.position_std or 0.0
    if where.position:
        fine = 3 if std == 0.0 or std >= _COARSE else math.ceil(-math.log10(std))
        at = "" if parts and not where.member else "at "
        parts.append(f"{at}({', '.join(f'{x:.{fine}f}' for x in where.position)}) m")
    if std >= _METRES:
        parts.append(f"± {std:.1f} m")
    elif std:
        parts.append(f"± {1000 * std:.0f} mm" if std >= _COARSE else f"± {1000 * std:.1g} mm")
    if where.channels:
        parts.append(f"in {', '.join(where.channels)}")
    text = " ".join(parts)
    if not where.member or where.name in ("", where.member):
        return text
    sensors = where.name.removeprefix(f"{where.member} at ")
    return f"{text}, {named if sensors == where.name else f'at {sensors}'}"


def at_place(name: str) -> str:
    """Return the name of a place with its preposition: `at the foot of the left post`, `on the beam at sensor A3`."""
    if not name:
        return ""
    begins = ("foot of", "joint of", "support ", "start of", "end of", "lower end of", "upper end of")
    return f"{'at' if name.startswith(begins) else 'on'} the {name}"


def parameter_texts(cause: FittedCause) -> list[tuple[str, str]]:
    """Return a cause's parameters, name and value, none of them twice; those of the model before and after.

    Parameters of the whole model that are within two deviations of the file are left out: `further_changes_text`.
    """
    if cause.changes:
        return _changed_texts(cause)
    repeated = {"loss"} if cause.parameters.keys() & set(_LOSSES) else set()
    found = {k: q for k, q in cause.parameters.items() if k not in repeated}
    shown = {k: q for k, q in found.items() if not k.startswith(_OFFSET) or _is_eccentric(k, q)}
    return [(parameter_name(name, q), parameter_text(name, q)) for name, q in shown.items()]


def parameter_name(name: str, quantity: Quantity) -> str:
    """Return the name of a parameter; of a temperature that fell, `colder by`; of a negative loss, `increase`."""
    if name == _WARMER:
        return f"{'colder' if quantity.value < 0 else 'warmer'} by"
    if name in _LOSS_NAMES and quantity.value < 0:
        return plain(name).replace("loss", "increase", 1)
    return plain(name)


def _is_eccentric(name: str, quantity: Quantity) -> bool:
    """Return whether a parameter is the offset of a body from the axis, and significant."""
    return name.startswith(_OFFSET) and abs(quantity.value) > ECCENTRIC * quantity.std


def further_changes(cause: FittedCause) -> tuple[ParameterChange, ...]:
    """Return the parameters of the whole model that were changed too, each within two deviations of the file."""
    return tuple(change for change in cause.changes if cause.where is None and not change.listed)


def further_changes_text(changes: Sequence[ParameterChange]) -> str:
    """Return the names of parameters within two deviations of the file in one line, by place; empty if there are none.

    Such as `within two deviations of the file: rotational stiffness about x, z at the foot of the left post`. Places
    with the same quantities are named together, and counted if they are many and of one kind. Of many places of several
    kinds those that are farthest from the file are named.
    """
    if not changes:
        return ""
    axes: dict[str, dict[str, list[str]]] = {}
    farthest: dict[str, float] = {}
    for change in changes:
        what, about, axis = change.quantity.rpartition(" about ")
        place = _named_quantity(change).removeprefix(change.quantity)
        axes.setdefault(place, {}).setdefault(f"{what}{about}" or axis, []).append(axis if what else "")
        farthest[place] = max(farthest.get(place, 0.0), change.deviations)
    found = _by_quantities(axes)
    more = ""
    if len(axes) > _MAX_NAMED and not (len(found) == 1 and _kind(axes)):
        named = sorted(axes, key=lambda place: -farthest[place])[:_FEW_NAMED]
        found = _by_quantities({place: axes[place] for place in axes if place in named})
        more = f"; and {len(axes) - len(named)} more"
    return f"within two deviations of the file: {'; '.join(w + _places_text(p) for w, p in found.items())}{more}"


def _by_quantities(axes: Mapping[str, Mapping[str, Sequence[str]]]) -> dict[str, list[str]]:
    """Return the places that have the same quantities, each with its axes."""
    places: dict[str, list[str]] = {}
    for place, found in axes.items():
        once = {what: dict.fromkeys(filter(None, about)) for what, about in found.items()}  # two joints at one place
        quantities = " and ".join(f"{what}{', '.join(about)}" for what, about in once.items())
        places.setdefault(quantities, []).append(place)
    return places


def uncertain_text(changes: Sequence[ParameterChange]) -> str:
    """Return the names of listed parameters that differ from the file by less than three deviations; empty if none."""
    names = [change.name for change in changes if _SURE > change.deviations > 0 and not change.at_bound]
    if not names:
        return ""
    return f"uncertain, two to three deviations from the file (--fix NAME keeps its value): {'; '.join(names)}"


def _places_text(places: Sequence[str]) -> str:
    """Return places, each with its preposition; the number of feet or joints if they are many."""
    kind = _kind(places) if len(places) > _MAX_NAMED else ""
    return f" at {len(places)} {kind}" if kind else ",".join(places)


def _kind(places: Iterable[str]) -> str:
    """Return what all of some places are, `feet` or `joints`; empty if they differ."""
    kinds = ((" at the foot of", "feet"), (" at the joint of", "joints"))
    return next((kind for begins, kind in kinds if all(place.startswith(begins) for place in places)), "")


def _changed_texts(cause: FittedCause) -> list[tuple[str, str]]:
    """Return name and value of each parameter that a cause changes, one unit for those of one kind.

    Springs whose stiffness before and after overlap are given by the flexibility added, which is determined better.
    """
    changes = [change for change in cause.changes if change.listed or cause.where is not None]
    springs = [c for c in changes if c.unit.startswith("N")]
    added = any(change.overlaps for change in springs)
    largest = max((abs(change.added_flexibility[0]) for change in springs), default=0.0)
    texts = []
    for change in changes:
        name = _parameter_name(cause, change)
        if added and change in springs:
            texts.append((name.replace("stiffness", "flexibility", 1), _added_text(change, largest)))
        else:
            least = min(c.after for c in changes if c.unit == change.unit)
            texts.append((name, " -> ".join(change_texts(change, least))))
    return texts


def _added_text(change: ParameterChange, largest: float) -> str:
    """Return the flexibility added to a spring, in the unit of the largest, and its share of the member's own."""
    value, std = change.added_flexibility
    scale, prefix = next((s, p) for least, s, p in _FINE_PREFIXES if 1e3 * largest >= least)
    unit = "rad per kN m" if change.unit == "N m/rad" else "m per kN"
    text = f"{number_text(1e3 * scale * value, 1e3 * scale * std, sign=True)} {prefix}{unit}"
    if change.member_stiffness is None:
        return text
    percent = 100 * change.member_stiffness
    own = f"{'L/GJ' if change.twists else 'L/4EI'} of the {change.member}"
    return f"{text} ({number_text(abs(percent * value), percent * std)} % of {own})"


def _parameter_name(cause: FittedCause, change: ParameterChange) -> str:
    """Return the quantity, with its place if the cause itself has none."""
    return _named_quantity(change) if cause.where is None else change.quantity


def parameter_change_text(change: ParameterChange) -> str:
    """Return a parameter of the model with its place or material, before and after."""
    return f"{_named_quantity(change)} {' -> '.join(change_texts(change))}"


def _named_quantity(change: ParameterChange) -> str:
    if change.place:
        return f"{change.quantity} {at_place(change.place)}"
    place = " at ({:g}, {:g}, {:g}) m".format(*change.position) if change.position else ""
    return f"{change.quantity} of {change.of}{place}"


def change_texts(change: ParameterChange, least: float | None = None) -> tuple[str, str]:
    """Return a parameter before and after, such as `rigid`, `60 ± 3 kN m/rad`; or `210`, `203.1 ± 0.4 GPa (-3.3 %)`.

    A value at a bound has no deviation: `205 GPa (-2.4 %), at its bound`.

    The unit is that of `least`, the smallest of several values, if given. Of a stiffness that may be infinite, such as
    that of a locked bearing, whose flexibility is Gaussian, only a lower bound is known: `over 12.7 MN m/rad (95 %)`.
    """
    bound = change.after / (1 + ONE_SIDED_95 * change.std / change.after) if change.after > 0 else change.after
    open_above = change.unit.startswith("N") and change.std > _OPEN * change.after
    shown = bound if open_above else change.after
    size, prefix = next(pair for pair in _PREFIXES if abs(shown if least is None else least) >= pair[0])
    scale, unit = 1 / (size or 1.0), f" {prefix}{change.unit}"
    if change.unit in {"-", "kg"}:
        scale, unit = 1.0, " kg" * (change.unit == "kg")
    before = "rigid" if change.before is None else number_text(scale * change.before, scale * change.before_std)
    if open_above:
        return before, f"over {scale * bound:.3g}{unit} (95 %)"
    relative = change.relative
    percent = f" ({signed_text(100 * relative[0], 100 * relative[1])} %)" if relative else ""
    bounded = ", at its bound" * change.at_bound
    return before, f"{number_text(scale * change.after, scale * change.std)}{unit}{percent}{bounded}"


def signed_text(value: float, std: float) -> str:
    """Return a change and its standard deviation, with the sign of an increase."""
    return f"{'+' if value > 0 else ''}{number_text(value, std)}"


def cause_text(cause: FittedCause) -> str:
    """Return one cause with its place and size in one line."""
    mass = cause.parameters.get("mass")
    if cause.cause == "added_mass" and mass:
        size = mass.model_copy(update={"value": abs(mass.value)})
        text = f"{quantity_text(size)} {'added' if mass.value > 0 else 'removed'} {where_text(cause.where)}".rstrip()
        eccentric = ((name, q) for name, q in cause.parameters.items() if _is_eccentric(name, q))
        offsets = " and ".join(f"{parameter_text(name, q)} along {name[-1]}" for name, q in eccentric)
        return text + f", its centre off the axis by {offsets}" * bool(offsets)
    texts = [f"{name} {value}" for name, value in parameter_texts(cause)]
    if len(texts) > _MANY and not cause.changes:
        texts[_FEW:] = [f"and {len(texts) - _FEW} more"]
    if further := further_changes(cause):
        texts.append(f"{'and ' * bool(texts)}{len(further)} {'more ' * bool(texts)}within two deviations of the file")
    values = ", ".join(texts)
    return " ".join(part for part in (plain(cause.cause), where_text(cause.where)) if part) + (
        f": {values}" if values else ""
    )


def placed_text(cause: FittedCause) -> str:
    """Return a cause with the name of its place, for a label at that place."""
    what = cause_text(cause).split(" on the ")[0].split(" at ")[0]
    place = at_place(cause.where.name) if cause.where else ""
    return f"{what} {place}".rstrip()


def alternative_texts(cause: Cause) -> list[str]:
    """Return the causes that the data cannot distinguish from one: each in one line, with its place and size.

    An alternative that was not fitted, because the search was limited to other causes, is its name alone.
    """
    fitted = {other.cause: other for other in cause.alternatives}
    return [cause_text(fitted[name]) if name in fitted else plain(name) for name in cause.cannot_be_told_from]


def breathing_text(cause: FittedCause) -> str:
    """Return whether a loss of stiffness opens and closes, and whether that decides; empty where it is not known."""
    if not isinstance(cause, Cause):
        return ""
    decides = _BY_MODES if cause.signals and cause.signals.decides else ""
    return "; ".join(filter(None, (_opening_text(cause.breathing), decides)))


def other_texts(cause: FittedCause) -> list[str]:
    """Return the connections like one that changed, each with the changes of its stiffness in one line.

    Such as `foot of the left post: no significant change (about y +1 ± 4 %)`.
    """
    places: dict[str, list[OtherStiffness]] = {}
    for one in cause.others if isinstance(cause, Cause) else ():
        place = one.name or "({:.3f}, {:.3f}, {:.3f}) m".format(*one.position)
        own = f" ({one.member})" if one.member else ""  # joints of several members may be at one node
        places.setdefault(place + own, []).append(one)
    return [f"{place}: {_stiffness_changes(found)}" for place, found in places.items()]


def _stiffness_changes(found: Sequence[OtherStiffness]) -> str:
    """Return the changes of stiffness at one place, and whether all are within their deviations."""
    text = ", ".join(
        f"{'about' if '_r' in one.parameter else 'along'} {one.parameter[-1]} "
        f"{signed_text(one.change_percent, one.std_percent)} %"
        for one in found
    )
    insignificant = all(abs(one.deviations) <= _INSIGNIFICANT for one in found)
    return f"no significant change ({text})" if insignificant else f"stiffness {text}"


def _opening_text(found: Breathing | None) -> str:
    if found is None:
        return ""
    share = number_text(100 * found.share.value, 100 * found.share.std)
    if found.open_time and found.significant:
        open_time = number_text(100 * found.open_time.value, 100 * found.open_time.std)
        absent = f"{share} % of the added flexibility is absent while it is closed"
        law = _LAWS[found.law or "one_side"]
        return f"{law}: open {open_time} % of the time; {absent}{_heldout_text(found.heldout)}"
    if found.upper_share < _CONSTANT:
        return f"it does not open and close, and has no play: {share} % of the added flexibility is absent at times"
    return ""


def _heldout_text(found: NonlinearGain | None) -> str:
    """Return the gain on held-out signals, after a semicolon; empty if not known."""
    if found is None:
        return ""
    gained = number_text(found.log_likelihood.value, found.log_likelihood.std, sign=True)
    return f"; log likelihood of held-out signals {gained}"


def probability_text(cause: Cause) -> str:
    """Return the probability of a cause, or of one of several."""
    return share_text(cause.probability) + " that it is one of these" * bool(cause.cannot_be_told_from)


def brief_text(cause: Cause) -> str:
    """Return a cause in one line; where the data cannot distinguish it from others, all of them without their sizes."""
    closing = f" ({_opening_text(cause.breathing)})" if cause.breathing and cause.breathing.significant else ""
    if not cause.cannot_be_told_from:
        return cause_text(cause) + closing
    fitted: dict[str, FittedCause] = {other.cause: other for other in (cause, *cause.alternatives)}
    names = (cause.cause, *cause.cannot_be_told_from)
    return " or ".join(_without_size(fitted[name]) if name in fitted else plain(name) for name in names) + closing


def _without_size(cause: FittedCause) -> str:
    """Return a cause with its place; of a mass with its size, which is short."""
    if cause.cause == "added_mass":
        return cause_text(cause)
    return " ".join(part for part in (plain(cause.cause), where_text(cause.where)) if part)


MARK = "*"  #: mark of a mode that is not `compared`
NOT_COMPARED = "not used: no confident match in the reference"
_AGREES_PERCENT = 1.0  # difference of the frequencies of a mode, measured and of the model with the causes


def unmeasured_text(found: DiscrepancyResult) -> str:
    """Return how many modes of the model were measured neither before nor now; empty for none."""
    absent = [mode.simulated for mode in found.modes if mode not in found.listed and mode.simulated is not None]
    if not absent:
        return ""
    count = counted(len(absent), "mode")
    return f"not measured, neither before nor now: {count} of the model, {_range_text(absent)}"


def lost_modes_text(found: DiscrepancyResult) -> str:
    """Return which modes of the reference logs the current ones lack, and the remedy; empty for none.

    New modes that the model with the causes has may be the same, changed beyond recognition.
    """
    lost = [mode.simulated for mode in found.listed if mode.measured is None and mode.simulated is not None]
    if not lost or not found.measured_before:
        return ""
    absent = f"{counted(len(lost), 'mode')} of the reference logs not found in the current ones ({_hertz(lost)})"
    new = [mode for mode in found.listed if mode.simulated is None and mode.measured is not None]
    off = [math.inf if mode.off_percent_after is None else abs(mode.off_percent_after) for mode in new]
    agreeing = [mode.measured for mode, percent in zip(new, off, strict=True) if percent < _AGREES_PERCENT]
    if len(agreeing) >= len(lost):
        return f"{absent}: with the causes the model has modes at {_hertz(agreeing)}, where they are measured now."
    changes = f"the changes of {len(lost) - len(agreeing)} of them" if agreeing else "their changes"
    return (
        f"{absent}: the answer does not use {changes}. Repeat with windows twice as long (--window), or record longer."
    )


def _hertz(frequencies: Sequence[float | None]) -> str:
    return ", ".join(f"{value:.4g}" for value in frequencies if value is not None) + " Hz"


def _range_text(frequencies: Sequence[float]) -> str:
    """Return lowest and highest frequency; those that have the same digits once, with their number."""
    first, last = (f"{value:.4g}" for value in (min(frequencies), max(frequencies)))
    if first != last:
        return f"{first} to {last} Hz"
    return {1: "", 2: "both at "}.get(len(frequencies), "all at ") + f"{first} Hz"


def failed_text(failed: Failed) -> str:
    """Return a part left out of an answer by an internal fault, and the fault."""
    return f"internal error, {_part_text(failed)} was not considered: {failed.error}"


def _part_text(failed: Failed) -> str:
    return " and ".join(map(plain, failed.part.split(" and ")))


def not_considered_text(diagnosis: Diagnosis) -> str:
    """Return the parts left out of an answer by internal faults, in brackets after a blank; empty if there are none."""
    parts = ", ".join(map(_part_text, diagnosis.failed))
    return f" (not considered because of internal errors: {parts})" if parts else ""


def mass_text(answer: MassAnswer) -> str:
    """Return the answer in one line."""
    places: list[MassAnswer | OtherPlace] = [answer, *answer.others]
    return " or ".join(_place_text(place) for place in places)


def _place_text(place: MassAnswer | OtherPlace) -> str:
    what = "added" if place.mass > 0 else "removed"
    x, y, z = place.position
    joint = f", {at_place(place.joint)}" if place.joint else ""
    share = f" ({share_text(place.probability)})" if isinstance(place, OtherPlace) else ""
    return (
        f"{number_text(1000 * abs(place.mass), 1000 * place.mass_std)} g {what} on the {place.member} "
        f"at ({x:.3f}, {y:.3f}, {z:.3f}) m ± {1000 * place.position_std:.0f} mm{joint}{share}"
    )


def member_share_text(answer: MassAnswer) -> str:
    """Return the probability that a mass is on its member, or at its joint."""
    there = at_place(answer.joint) if answer.joint else f"on the {answer.member}"
    return f"{share_text(answer.member_probability)} that it is {there}"


def forecast_text(forecast: "AccuracyForecast", mass_std: float) -> str:
    """Return what more windows would add to the accuracy of a located mass.

    Parameters
    ----------
    forecast : of this mass
    mass_std : its present standard deviation [kg], whose decimals the predicted one has
    """
    least_mass = rounded_text(1e3 * forecast.least_mass_std, 1e3 * mass_std)
    least = f"{1e3 * forecast.least_distance_std:.0f} mm and {least_mass} g"
    if forecast.limited_by == "windows":
        until = f"up to about {forecast.enough} windows: {least} at best"
        return f"the deviation decreases with the square root of the number of windows, {until}"
    what = {"baseline": "a longer baseline", "model": "a better model or another sensor"}[forecast.limited_by]
    return f"more windows will not reduce the deviation under {least}; {what} would"


def change_text(diagnosis: Diagnosis) -> str:
    """Return the change, if there is one, as a part of a sentence."""
    if diagnosis.verdict == "nothing_to_explain":
        return "too small for a cause to be named"
    if not diagnosis.causes:
        poor_model = diagnosis.calibration is not None and not diagnosis.calibration.fits_reference
        nothing = "the model does not fit the reference logs" if poor_model else "no known cause explains it"
        return f"{nothing}{not_considered_text(diagnosis)}"
    return "; ".join(map(brief_text, listed_causes(diagnosis.causes)))


def calibration_text(summary: CalibrationSummary) -> str:
    """Return how many modes were paired with the model before and after its calibration, and its frequency errors."""
    paired, error = summary.modes_paired, summary.frequency_error_percent
    return (
        f"model calibrated: {paired.before} of {summary.modes_measured} measured modes paired before calibration, "
        f"{paired.after} after it; frequency error {error.before:.3g} -> {error.after:.3g} % rms"
    )


def gain_text(pair: Pair, std: Pair | None, form: str) -> tuple[str, str]:
    """Return a figure without and with the causes, each with its standard deviation where that is known."""
    deviations = (std.before, std.after) if std else (None, None)
    before, after = (
        "" if value is None else number_text(value, deviation) if deviation else format(value, form)
        for value, deviation in zip((pair.before, pair.after), deviations, strict=True)
    )
    return before, after


def gain_texts(gain: Gain, std: Gain | None) -> list[str]:
    """Return the frequency error of a written model on the data that it was fitted to and on data not used, by lines.

    Followed by what remains relative to noise, and the error of the shapes.
    """
    if gain.frequency_error_percent.after is None:
        return [f"the written model has none of the {gain.n_measured} measured modes"]
    before, after = gain_text(gain.frequency_error_percent, std.frequency_error_percent if std else None, ".3f")
    data = "on data not used (held-out logs)" if gain.heldout else "on the data that it was fitted to"
    modes = f"{gain.n_modes} of {gain.n_measured} modes"
    texts = [f"{data}: {before or 'none of these modes'} -> {after} % rms ({modes})"]
    error = gain.change_error_percent
    if error is not None and error.before is not None and error.after is not None and not _is_repeated(gain):
        texts.append(f"{predicted_text(gain)}: {error.before:.3g} -> {error.after:.3g} % rms")
    if gain.noise_percent is not None:
        texts.append(remainder_text(gain))
    if gain.one_minus_mac.before is not None:
        errors = gain_text(gain.one_minus_mac, std.one_minus_mac if std else None, ".2g")
        texts.append("shapes, 1 - MAC: {} -> {}".format(*errors))
    return texts


def _is_repeated(gain: Gain) -> bool:
    """Return whether the errors of predicted changes are those of frequencies: held-out logs, no reference."""
    error, change = gain.frequency_error_percent, gain.change_error_percent
    pairs = (
        [(a, b) for a, b in ((error.before, change.before), (error.after, change.after)) if a and b] if change else []
    )
    return gain.heldout and all(math.isclose(a, b, rel_tol=_SAME_ERROR) for a, b in pairs)


def predicted_text(gain: Gain) -> str:
    """Return the name of the error of predicted changes: on held-out logs, or of each mode from the others."""
    if gain.heldout:
        return "changes since the reference, on data not used"
    return "on data not used (each mode predicted from a fit to the others)"


def remainder_text(gain: Gain) -> str:
    """Return whether the written model leaves more than measurement noise, and more than any model of beams may."""
    noise = f"measurement noise ({gain.noise_percent:.2g} %)"
    left = f"what remains is {'more than' if gain.exceeds_noise else 'within'} {noise}"
    after = gain.frequency_error_percent.after
    if not gain.exceeds_noise or after is None:
        return left
    usual = 100 * FREQUENCY_STD
    return f"{left} and {'less' if after <= usual else 'more'} than the usual error of a beam model ({usual:.2g} %)"


def missed_text(sensors: Sequence[SensorComparison]) -> str:
    """Return the share of all signals that the prediction from other sensors misses; empty if there is none."""
    missed = [s.missed for s in sensors if s.missed is not None]
    if not missed:
        return ""
    text = f"Virtual-sensor prediction error: {100 * _root_mean_square(missed):.1f} % rms"
    after = [s.missed_after for s in sensors if s.missed_after is not None]
    if after:
        text += f" without the causes, {100 * _root_mean_square(after):.1f} % with them"
    return text + "."


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def position_text(position: Vector, name: str = "", digits: int = 2) -> str:
    """Return a position [m] with its preposition, after the name of its place if it has one."""
    place = f"({', '.join(f'{x:.{digits}f}' for x in position)}) m"
    return f"{at_place(name)}, {place}" if name else f"at {place}"


def left_over_text(
    balance: BalanceResult, nodes: Sequence[Vector], name: Callable[[Vector], str] = lambda _: ""
) -> str:
    """Return where residual forces are largest, in the interpretation favoured by the modes; empty if not significant.

    Parameters
    ----------
    balance : of the nodes
    nodes : their positions [m]; nothing is stated for those of another model
    name : returns the name of a place
    """
    if abs(balance.log_odds) <= CLEAR_ODDS or len(nodes) != len(balance.loss):
        return ""
    of_mass = balance.log_odds > 0
    values, stds = (balance.added, balance.added_std) if of_mass else (balance.loss, balance.loss_std)
    known = [(v, s, at) for v, s, at in zip(values, stds, nodes, strict=True) if v is not None and s is not None]
    if not known:
        return ""
    value, std, at = max(known, key=lambda one: abs(one[0]))
    if abs(value) <= SIGNIFICANT * std:
        return ""
    what = f"{'excess' if of_mass == (value > 0) else 'missing'} {'mass' if of_mass else 'stiffness'}"
    return f"residual forces indicate {what}, largest {position_text(at, name(at))} (no cause assumed)"


def increment_text(increments: MassIncrements) -> str:
    """Return how many nodes the one-step update flags, and the place of the change or why none is claimed."""
    flagged = len({f.node for f in increments.flagged})
    if not flagged:
        return "one-step update flags no node"
    place = place_text(increments.place)
    return f"one-step update flags {flagged} node{'s' * (flagged > 1)}{f', {place}' if place else ''}"


def place_text(place: IncrementPlace | None) -> str:
    """Return the place that the increments of all nodes support with its 95 % region, or why they support none."""
    if place is None:
        return ""
    if not place.fits:
        p = f"p = {place.p_value:.2g}" if place.p_value > MIN_P else f"p < {MIN_P:.0e}"
        return f"not located: the increments do not fit one mass ({p})"
    x, y, z = place.position
    if place.located:
        return f"consistent with one mass at ({x:.2f}, {y:.2f}, {z:.2f}) m, 95 % within {place.radius:.2f} m"
    length = sum(math.dist(part.start, part.end) for part in place.region)
    members = ", ".join(dict.fromkeys(part.member for part in place.region))
    return f"not located by these alone: one mass fits anywhere within {length:.2g} m of {members}"
