"""Messages on unknown keys and names in a structure file."""

import difflib
from collections.abc import Collection

_LEAST_BEGINNING = 2  # letters of a word, from which on they stand for it


def meant(word: str, known: Collection[str]) -> str:
    """Return the question whether another word was meant: one that is cut short, or that is spelt nearly so."""
    begun = [name for name in known if len(word) >= _LEAST_BEGINNING and name.startswith(word.lower())]
    near = begun or difflib.get_close_matches(word.lower(), known, 1)
    return f", did you mean {near[0]!r}?" if near else ""


def not_known(word: str, known: Collection[str]) -> str:
    """Say that a key is none, which one may have been meant, and which there are."""
    return f"not a known key{meant(word, known)}; known here are {', '.join(known)}"
