"""Filters of Epson's M-A352 and M-A552: choice by sampling rate, group delay.

FILTER_CTRL, or object 61A1h:1, chooses one of ten low-passes with 64, 128 or 512 taps (Kaiser window, linear phase): a
scan tells the motion of half their length before. Which fits a rate is what the vendor's driver chooses.

They run before the rate is lowered, here taken as 4000 scans a second. The vendor's driver does not say; its table fits
that: 512 taps with 60 dB fall off within 28 Hz at 4000 (Kaiser's formula), so that the one of 9 Hz ends at 23, just
before 25 Hz, where folding begins at 50 scans a second. Whoever has measured another delay can say so (`delay_ms`).

References
----------
esensorlib 2.1.0 (Seiko Epson), `accl_fn.py`, `ma352ad10.py`.
Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., eq. 7.76.
"""

INTERNAL_RATE = 4000.0  #: that filters run at [Hz]
TAPS = {1: 64, 2: 64, 3: 128, 4: 128, 5: 128, 6: 512, 7: 512, 8: 512, 9: 512, 10: 512}
CUTOFF = {1: 83, 2: 220, 3: 36, 4: 110, 5: 350, 6: 9, 7: 16, 8: 60, 9: 210, 10: 460}  #: [Hz]
FILTERS = {1000: 10, 500: 9, 200: 8, 100: 7, 50: 6}  #: scans a second -> filter that fits


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
