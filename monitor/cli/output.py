"""Files that commands write for other programs."""

import json
from pathlib import Path
from typing import Any

from monitor.errors import ArgumentError


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write the file that --json names.

    Raises
    ------
    ArgumentError
        If it cannot be written.
    """
    try:
        path.write_text(json.dumps(content, indent=1), encoding="utf-8")
    except OSError as error:
        raise ArgumentError("--json", f"{path}: cannot be written: {error.strerror}") from error
