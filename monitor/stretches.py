"""Stretches of members on which something holds, and quantities in words."""

from updater import Outlook

_HEAVY = 0.1  # of the structure's mass: where not even so much is noticed, the rig is blind
Stretches = list[tuple[float, float]]


def heaviest(outlook: Outlook) -> float:
    """Return the mass [kg] beyond which nobody would call it a weak one: where only that shows the rig is blind."""
    return _HEAVY * outlook.reference.calibration.model.total_mass()


def blind(outlook: Outlook, weakest: list[float], member: int) -> Stretches:
    """Return the stretches of a member [m] on which a tenth of the structure's mass raises no alarm.

    Parameters
    ----------
    outlook : of the structure
    weakest : (n_places,) mass that raises the alarm [kg]
    member : its index
    """
    found: Stretches = []
    going = False
    for here, position, mass in zip(outlook.member, outlook.places.position, weakest, strict=True):
        if here != member or mass <= heaviest(outlook):
            going = False
        elif going:
            found[-1] = found[-1][0], float(position)
        else:
            found.append((float(position), float(position)))
            going = True
    return found


def stretches_text(found: Stretches) -> str:
    """Return stretches as words, nothing for none."""
    return ", ".join(f"{start:.2f} to {stop:.2f}" for start, stop in found)


def mass_words(mass: float) -> str:
    """Return a mass in grams or kilograms, to two digits."""
    if mass >= 1:
        return f"{mass:.2g} kg" if mass < 10 else f"{mass:.0f} kg"
    return f"{1000 * mass:.2g} g" if mass < 0.1 else f"{1000 * mass:.0f} g"


def duration_words(seconds: float) -> str:
    """Return a duration in seconds, minutes or hours."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.3g} h"
