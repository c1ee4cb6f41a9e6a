"""Datagrams of a Raspberry Shake: as published, incomplete, damaged, and from a clock that was set."""

import itertools
import socket
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq import DeviceIdentity, DeviceLost, DriverError, SystemClock, make_driver
from daq.emulator import EmulatedShake, FaultyNetwork, free_port
from daq.protocol.raspberry_shake import CHANNELS, SAMPLES, ShakeDecoder, encode_packet
from tests.support.daq.can_buses import serving
from tests.support.daq.emulated_ports import Ramp

#: datagrams in the form of the manual: blanks after commas, three digits of the time
PUBLISHED = b"{'EHZ', 1582315130.292, 14168, 14927, 16112, 15012}"
START = 1_582_315_130.292


def packets(n: int, time: float = START) -> list[bytes]:
    """Return the datagrams of n sets, one after another: scan k is (k, -k, 3 k)."""
    found = []
    for number in range(n):
        k = SAMPLES * number + np.arange(SAMPLES, dtype=np.int32)
        values = zip(CHANNELS, (k, -k, 3 * k), strict=True)
        found += [encode_packet(name, time + k[0] / 100, axis) for name, axis in values]
    return found


def test_published_form_is_written_and_read() -> None:
    assert encode_packet("EHZ", 1582315130.292, np.array([14168, 14927, 16112, 15012], np.int32)) == PUBLISHED
    decoder = ShakeDecoder()
    assert len(decoder.feed(PUBLISHED).time) == 0  # a velocity
    assert (decoder.channels, decoder.bad_bytes) == ({"EHZ"}, 0)
    other = b"".join(
        f"{{'{name}',{START},{k},{-k}}}".encode() for k, name in enumerate(CHANNELS)
    )  # without blanks, as of other programs
    assert decoder.feed(other).counts.tolist() == [[0, 1, 2], [0, -1, -2]]


@given(st.lists(st.integers(0, 4000), max_size=12), st.permutations(range(9)))
@settings(max_examples=30)
def test_scans_are_complete_in_any_pieces_and_order_of_channels(cuts: list[int], order: list[int]) -> None:
    sent = packets(3)
    stream = b"".join(sent[k] for k in sorted(order, key=lambda k: (k // 3, order[k])))
    decoder, edges = ShakeDecoder(), [0, *sorted(cut % len(stream) for cut in cuts), len(stream)]
    found = [decoder.feed(stream[a:b]) for a, b in itertools.pairwise(edges)]
    k = np.arange(3 * SAMPLES)
    np.testing.assert_array_equal(np.concatenate([f.counts for f in found]), np.stack([k, -k, 3 * k], axis=1))
    np.testing.assert_allclose(np.concatenate([f.time for f in found]), START + k / 100, atol=1e-6)
    assert decoder.bad_bytes == 0


def test_set_without_a_channel_is_dropped_and_counted() -> None:
    sent = packets(20)
    del sent[4]  # of the second set
    decoder = ShakeDecoder()
    counts = decoder.feed(b"".join(sent)).counts[:, 0]
    np.testing.assert_array_equal(counts, np.setdiff1d(np.arange(20 * SAMPLES), SAMPLES + np.arange(SAMPLES)))
    for more in range(9):  # it is given up once others wait
        decoder.feed(packets(1, START + 100 + more)[0])
    assert decoder.bad_bytes >= len(sent[3]) + len(sent[4])


@given(
    st.one_of(st.binary(max_size=200), st.lists(st.sampled_from([*packets(1), b"{", b"}", b"'", b", 5"])).map(b"".join))
)
def test_arbitrary_datagrams_are_read_or_counted(data: bytes) -> None:
    decoder = ShakeDecoder()
    found = decoder.feed(data)
    assert found.counts.shape == (len(found.time), 3)
    assert 0 <= decoder.bad_bytes <= len(data)


@pytest.mark.parametrize("place", ["/dev/ttyUSB0", "tcp://127.0.0.1:8888"])
def test_other_places_and_rates_are_refused(place: str) -> None:
    with pytest.raises(ValueError, match="port: expected udp://:PORT, found"):
        make_driver("raspberry-shake", place, 100.0)
    with pytest.raises(ValueError, match=r"rate of udp://:8888: expected one of \[100\] Hz, found 50"):
        make_driver("raspberry-shake", "udp://:8888", 50.0)


@pytest.mark.live
def test_lost_datagrams_are_gaps_of_whole_sets() -> None:
    network = FaultyNetwork(free_port(), lost=0.1, repeated=0.1, exchanged=0.1, seed=2)
    clock = SystemClock()
    device = EmulatedShake(Ramp(), clock, network, clock_error=2e-3)
    device._began -= 8 * 10**9  # eight seconds are sent at once
    with serving(device.serve):
        driver = make_driver("raspberry-shake", device.port, 100.0)
        identity = driver.open()
        reads = [driver.read()]
        while sum(len(scans.counts) for scans in reads) < 80:
            reads.append(driver.read())
        driver.close()
    device.close()
    assert identity == DeviceIdentity(product="Raspberry Shake")
    k = np.concatenate([scans.counts[:, 0] for scans in reads])
    counter = np.concatenate([scans.counter for scans in reads]).astype(np.int64)
    np.testing.assert_array_equal(counter - counter[0], k - k[0])


@pytest.mark.live
def test_missing_accelerometer_and_a_clock_that_is_set_are_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("daq.drivers.network.raspberry_shake._WAIT_SECONDS", 0.3)
    number = free_port()
    driver = make_driver("raspberry-shake", f"udp://127.0.0.1:{number}", 100.0)
    stop = threading.Event()
    datagrams = [PUBLISHED]

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not stop.wait(0.01):
                for datagram in datagrams:
                    line.sendto(datagram, ("127.0.0.1", number))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(DriverError, match=r"channels: expected ENE, ENN, ENZ within 0\.3 s, found EHZ$"):
            driver.open()
        for later in (-3600, 3600):
            datagrams[:] = packets(4)
            driver.open()
            datagrams[:] = packets(1, START + later)
            with pytest.raises(DeviceLost, match="the clock of the Raspberry Shake was set"):  # noqa: PT012
                end = time.monotonic() + 5.0
                while time.monotonic() < end:
                    driver.read()
            driver.close()
    finally:
        stop.set()
        thread.join()
        driver.close()
