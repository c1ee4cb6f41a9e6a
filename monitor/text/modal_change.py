"""Texts on the change of measured modes, where no model explains it."""

import math
from collections.abc import Callable

from daq.notebook import number_text, rounded_text
from monitor.results.windows import ModalChange, ModalQuantity, ModeChange

_MAX_LISTED = 4  # modes per quantity


def modal_change_text(change: ModalChange) -> str:
    """Return the significant changes of frequencies, shapes and damping, as part of a sentence."""
    texts: dict[ModalQuantity, Callable[[ModeChange], str]] = {
        "frequency": _shift_text,
        "shape": lambda mode: f"mode {mode.id} (MAC {mode.mac:.4f})",
        "damping": _damping_text,
    }
    parts = [_changed(change, quantity, text) for quantity, text in texts.items()]
    return "; ".join(part for part in parts if part) or _largest(change)


def modal_change_headline(change: ModalChange) -> str:
    """Return the number of frequencies that moved and the largest shift, as part of a sentence."""
    moved = [mode for mode in change.modes if "frequency" in mode.changed]
    if not moved:
        return modal_change_text(change)
    largest = max(moved, key=lambda mode: abs(mode.shift_percent))
    return f"{len(moved)} of {len(change.modes)} frequencies moved, the largest shift is of {_shift_text(largest)}"


def _changed(change: ModalChange, quantity: ModalQuantity, text: Callable[[ModeChange], str]) -> str:
    """Return the modes of which a quantity changed, those of shapes by MAC; empty if there is none."""
    modes = [mode for mode in change.modes if quantity in mode.changed]
    found = [text(mode) for mode in (sorted(modes, key=lambda mode: mode.mac) if quantity == "shape" else modes)]
    more = f" and {len(found) - _MAX_LISTED} more" if len(found) > _MAX_LISTED else ""
    return f"{quantity} of {', '.join(found[:_MAX_LISTED])}{more}" if found else ""


def _largest(change: ModalChange) -> str:
    """Return the largest shift, where no mode alone changed significantly."""
    known = [mode for mode in change.modes if math.isfinite(mode.shift_percent)]
    if not known:
        return "none of the modes identified"
    largest = max(known, key=lambda mode: abs(mode.shift_percent / mode.shift_std_percent))
    return f"no mode changed significantly by itself; largest frequency shift: {_shift_text(largest)}"


def _shift_text(mode: ModeChange) -> str:
    shift = number_text(mode.shift_percent, mode.shift_std_percent, sign=True)
    return f"mode {mode.id} ({mode.frequency:.4g} Hz) {shift} %"


def _damping_text(mode: ModeChange) -> str:
    """Return damping before and now, in per cent of critical damping."""
    before, now, std = 100 * mode.damping, 100 * (mode.damping + mode.damping_shift), 100 * mode.damping_shift_std
    return f"mode {mode.id} from {rounded_text(before, std)} to {number_text(now, std)} %"
