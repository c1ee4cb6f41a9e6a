"""Filters of Epson's M-A352 and M-A552: choice by sampling rate, group delay.

FILTER_CTRL, or object 61A1h:1, selects one of ten low-pass filters with 64, 128 or 512 taps (Kaiser window, linear
phase). The delay of a scan is half their length. The filter of each rate is that of the vendor's driver.

The filters run before decimation, here assumed at 4000 scans per second. The vendor's driver does not state this, but
its table agrees: 512 taps with 60 dB fall off within 28 Hz at 4000 Hz (Kaiser's formula), so that the filter of 9 Hz
ends at 23 Hz, just below 25 Hz, where aliasing begins at 50 scans per second. `delay_ms` in the settings overrides the
delay.

References
----------
esensorlib 2.1.0 (Seiko Epson), `accl_fn.py`, `ma352ad10.py`.
Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., eq. 7.76.
"""

INTERNAL_RATE = 4000.0  #: rate of the filters [Hz]
TAPS = {1: 64, 2: 64, 3: 128, 4: 128, 5: 128, 6: 512, 7: 512, 8: 512, 9: 512, 10: 512}
CUTOFF = {1: 83, 2: 220, 3: 36, 4: 110, 5: 350, 6: 9, 7: 16, 8: 60, 9: 210, 10: 460}  #: [Hz]
FILTERS = {1000: 10, 500: 9, 200: 8, 100: 7, 50: 6}  #: scans per second -> filter that fits


def group_delay(number: int) -> float:
    """Return how long after the motion a scan is that a filter lets through [s].

    Raises
    ------
    ValueError
        If there is no such filter.
    """
    if number not in TAPS:
        raise ValueError(f"filter: expected one of {sorted(TAPS)}, found {number}")
    return (TAPS[number] - 1) / 2 / INTERNAL_RATE
