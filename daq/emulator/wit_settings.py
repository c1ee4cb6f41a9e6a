"""Settings of an emulated WT901: the same commands on a serial line and on a CAN bus."""

import numpy as np
import numpy.typing as npt

from daq.protocol import witmotion as wit
from daq.types import IntArray

_AS_BOUGHT = 0b11110  # accelerations, turning rates, angles and field
_LARGEST = 2**15 - 1


class WitSettings:
    """Registers, which are written once they are unlocked.

    Parameters
    ----------
    temperature : that it sends with its accelerations [degC]
    """

    def __init__(self, temperature: float) -> None:
        self._temperature = round(100 * temperature)
        self._content, self._unlocked = _AS_BOUGHT, False
        self.rate = 10.0  #: scans a second [Hz]
        self.delay = 0.0  #: group delay of the filter [s]; a new device has none

    def obey(self, command: bytes) -> bool:
        """Execute a command of five bytes; return whether sampling restarts at another rate."""
        if command == wit.UNLOCK:
            self._unlocked = True
        if command == wit.UNLOCK or not self._unlocked:
            return False
        address, value = command[2], command[3] | command[4] << 8
        if address == wit.CONTENT:
            self._content = value
        elif address == wit.BANDWIDTH:
            self.delay = wit.DELAY.get(value, 0.0)
        rates = [rate for rate, (code, _) in wit.RATES.items() if (address, value) == (wit.RATE, code)]
        self.rate = float(rates[0]) if rates else self.rate
        return bool(rates)

    def packets(self, counts: IntArray) -> list[tuple[int, npt.NDArray[np.int16]]]:
        """Return the types of packets that it sends, in their order, and the words (n, 4) of each for scans (n, 3)."""
        words = np.zeros((len(counts), 4), np.int16)
        words[:, :3] = np.clip(counts, -_LARGEST - 1, _LARGEST)
        words[:, 3] = self._temperature
        kinds = [wit.FIRST_TYPE + bit for bit in range(wit.N_TYPES) if self._content >> bit & 1]
        return [(kind, words if kind == wit.ACCELERATION else 0 * words) for kind in kinds]
