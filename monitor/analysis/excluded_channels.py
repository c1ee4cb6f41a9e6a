"""Channels without shapes in any window, grouped by reason."""

from collections.abc import Mapping

from oma.preparation import SAME_AS

_COPIES = "contain identical samples (error of cabling or export?)"


def told_apart(given_up: Mapping[str, str]) -> tuple[list[tuple[str, ...]], dict[str, str]]:
    """Return groups of channels with identical samples, and the other channels with their faults.

    Parameters
    ----------
    given_up : channel -> fault
    """
    other_of = {name: _copied(fault, given_up) for name, fault in given_up.items()}
    groups: list[set[str]] = []
    for name, other in other_of.items():
        if other is not None:
            near = [group for group in groups if group & {name, other}]
            groups = [group for group in groups if group not in near] + [{name, other}.union(*near)]
    rest = {name: fault for name, fault in given_up.items() if other_of[name] is None}
    return [tuple(name for name in given_up if name in group) for group in groups], rest


def _copied(fault: str, names: Mapping[str, str]) -> str | None:
    """Return the channel with identical samples that a fault names."""
    name_of_other = fault.removeprefix(SAME_AS) if fault.startswith(SAME_AS) else ""
    return next((name for name in names if name_of_other == name or name_of_other.startswith(f"{name} (in ")), None)


def by_reason(given_up: Mapping[str, str]) -> list[tuple[tuple[str, ...], str]]:
    """Return groups of channels, and the fault of each: identical samples, or the same fault."""
    same, rest = told_apart(given_up)
    alike: dict[str, tuple[str, ...]] = {}
    for name, fault in rest.items():
        alike[fault] = (*alike.get(fault, ()), name)
    return [(group, _COPIES) for group in same] + [(names, fault) for fault, names in alike.items()]


def left_out_texts(given_up: Mapping[str, str]) -> list[str]:
    """Return texts on the channels that are left out, with the reasons."""
    return [_text(names, why) for names, why in by_reason(given_up)]


def _text(names: tuple[str, ...], why: str) -> str:
    listed = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
    if why == _COPIES:
        return f"{listed} {why}: left out, because it is not known which of them is correct"
    return f"{listed} {'are' if len(names) > 1 else 'is'} left out: {why}"
