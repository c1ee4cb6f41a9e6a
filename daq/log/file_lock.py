"""Lock on an open file against repair by another process; released with the process."""

import sys
from typing import IO

if sys.platform == "win32":

    def lock(file: IO[bytes]) -> bool:
        """Return that the file is ours: Windows does not let another process replace a file that is open."""
        return not file.closed
else:
    import fcntl

    def lock(file: IO[bytes]) -> bool:
        """Lock an open file until it is closed; False if another one holds it."""
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
