"""Device readers that tests let run."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from daq import DeviceReader


@contextmanager
def running(readers: Sequence[DeviceReader]) -> Iterator[None]:
    """Connect each and start it at once, as a device streams from its connection on; stop and join them at the end."""
    try:
        for reader in readers:
            reader.connect()
            reader.start()
        yield
    finally:
        for reader in readers:
            reader.stop()
        for reader in readers:
            if reader.is_alive():
                reader.join(10.0)
