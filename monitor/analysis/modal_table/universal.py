"""Universal files, recognized by their names."""

from pathlib import Path

UNIVERSAL = (".uff", ".unv")  #: endings of universal files


def is_universal(path: Path) -> bool:
    """Return whether a file is a universal one, by its name."""
    return path.suffix.lower() in UNIVERSAL
