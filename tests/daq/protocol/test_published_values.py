"""Constants of wire formats against published values: vendors' drivers, data sheets and standards, written out here.

A driver and an emulator that share a wrong constant agree with each other; these tests compare neither with the other.

References
----------
esensorlib 2.1.0 (Seiko Epson), model/ma352ad10.py, accl_fn.py.
Seiko Epson, M-A552AC10 data sheet, object dictionary; CiA 301 v4.2, 7.5.2.
WitMotion, WT901 datasheet v20-0702; InvenSense, MPU-9250 register map rev. 1.6, table of ACCEL_CONFIG_2.
Linux, include/uapi/linux/can.h; Lawicel AB, CAN232 manual v3.
"""

import numpy as np
import pytest
from esensorlib.model import ma352ad10 as vendor
from scipy.constants import g

from daq.protocol import epson, epson_can, epson_filters, frames, node, slcan, witmotion

COUNTS_OF_ONE_G = 16_777_216  # "16777216 LSB/G"


@pytest.mark.parametrize("scale", [epson.EPSON_SCALE, epson_can.SCALE])
def test_epson_scale_is_two_to_the_minus_24_g_per_count(scale: float) -> None:
    assert scale * COUNTS_OF_ONE_G == pytest.approx(g, rel=1e-12)
    assert scale / g * 1000 == pytest.approx(vendor.SF_ACCL, rel=1e-12)  # mG a count


def test_epson_temperature_matches_vendor_driver() -> None:
    raw = np.array([-8000, 0, 1, 2635])
    assert epson.temperature_celsius(raw) == pytest.approx(vendor.SF_TEMPC * raw + vendor.TEMPC_OFFSET, rel=1e-12)
    assert epson.temperature_celsius(2635) == pytest.approx(24.9956, abs=1e-4)
    assert [epson.temperature_raw(float(t)) for t in epson.temperature_celsius(raw)] == raw.tolist()


def test_epson_registers_match_vendor_driver() -> None:
    reg = vendor.Reg
    low = {"WIN_CTRL": epson.WINDOW, "FILTER_CTRL": epson.FILTER_CTRL, "UART_CTRL": epson.UART_CTRL, "ID": epson.ID}
    low |= {"BURST_CTRL": epson.BURST_CTRL_LOW, "VERSION": epson.VERSION}
    high = {"MODE_CTRL": epson.MODE_CTRL, "SMPL_CTRL": epson.SMPL_CTRL, "BURST_CTRL": epson.BURST_CTRL_HIGH}
    assert low == {name: reg[name].ADDR for name in low}
    assert high == {name: reg[name].ADDRH for name in high}
    assert list(epson.PRODUCT) == [reg[f"PROD_ID{k}"].ADDR for k in (1, 2, 3, 4)]
    assert list(epson.SERIAL) == [reg[f"SERIAL_NUM{k}"].ADDR for k in (1, 2, 3, 4)]


def test_epson_register_values_match_vendor_driver() -> None:
    assert (vendor.MODE_CMD["SAMPLING"], vendor.MODE_CMD["CONFIG"]) == (epson.MODE_SAMPLING, epson.MODE_CONFIG)
    assert epson.RATES == vendor.DOUT_RATE
    assert (epson.HEADER, epson.DELIMITER) == (vendor.BURST_MARKER, vendor.DELIMITER)
    assert epson.IDENTITY.to_bytes(2, "little") == b"ES"
    # FLAG, TEMP, ACCX, ACCY, ACCZ; COUNT and CHKSM: bits 15, 14, 10, 9, 8; 1, 0
    assert epson.BURST_ALL == 1 << 15 | 1 << 14 | 1 << 10 | 1 << 9 | 1 << 8 | 1 << 1 | 1 << 0
    assert epson.FILTER_BUSY == 0x0020
    assert epson.UART_AUTO == 0x01
    assert epson.FRAME_SIZE == 24


def test_epson_filters_match_vendor_driver() -> None:
    kaiser = {name: number for name, number in vendor.FILTER_SEL.items() if name.startswith("K")}
    assert epson_filters.FILTERS == {1000: 10, 500: 9, 200: 8, 100: 7, 50: 6}  # as accl_fn.py chooses
    assert {
        f"K{taps}_FC{epson_filters.CUTOFF[number]}": number for number, taps in epson_filters.TAPS.items()
    } == kaiser


def test_epson_can_objects_match_standard_and_data_sheet() -> None:
    assert (epson_can.TPDO1, epson_can.TPDO2, epson_can.SYNC) == (0x180, 0x280, 0x80)  # CiA 301, table 74
    assert (epson_can.TPDO1_COB, epson_can.TPDO2_COB) == ((0x1800, 1), (0x1801, 1))
    assert epson_can.TRANSMISSION == (0x1800, 2)
    assert (epson_can.BY_SYNC, epson_can.BY_TIMER) == (1, 254)
    assert (epson_can.COB_OFF, epson_can.COB_NO_RTR, epson_can.SYNC_PRODUCER) == (0x8000_0000, 0x4000_0000, 0x4000_0000)
    assert (epson_can.SYNC_COB, epson_can.SYNC_PERIOD) == ((0x1005, 0), (0x1006, 0))
    assert epson_can.HEARTBEAT == (0x1017, 0)
    assert (epson_can.DEVICE_NAME, epson_can.HARDWARE, epson_can.SOFTWARE) == ((0x1008, 0), (0x1009, 0), (0x100A, 0))
    assert epson_can.SERIAL == (0x1018, 4)
    assert (epson_can.PERIOD, epson_can.APPLY, epson_can.FILTER) == ((0x2001, 0), (0x2005, 0), (0x61A1, 1))
    assert epson_can.TEMPERATURE == (0x9130, 4)
    assert (epson_can.APPLY_NOW, epson_can.APPLIED) == (0x11, 0x10)
    assert epson_can.RATES == {1000: 1, 500: 2, 200: 5, 100: 10, 50: 20}
    assert (epson_can.TPDO1_SIZE, epson_can.TPDO2_SIZE) == (8, 6)


def test_epson_can_frame_layout_matches_data_sheet() -> None:
    sent = list(epson_can.encode_scans(3, np.array([[1, -2, COUNTS_OF_ONE_G]], np.int32), 65_535))
    assert sent == [(0x183, bytes.fromhex("01000000feffffff")), (0x283, bytes.fromhex("00000001ffff"))]
    twice = list(epson_can.encode_scans(127, np.zeros((2, 3), np.int32), 65_535))
    assert [data[4:] for number, data in twice if number == 0x2FF] == [b"\xff\xff", b"\x00\x00"]


def test_witmotion_values_match_data_sheet() -> None:
    assert pytest.approx(g, rel=1e-12) == witmotion.SCALE * 2048  # 32768 counts are 16 g
    assert bytes.fromhex("ff aa 69 88 b5") == witmotion.UNLOCK
    assert (witmotion.CONTENT, witmotion.RATE, witmotion.BANDWIDTH) == (0x02, 0x03, 0x1F)
    assert witmotion.ONLY_ACCELERATION == 0x02  # RSW: bit 0 time, bit 1 acceleration, bit 2 angular rate
    assert (witmotion.NODE, witmotion.BITRATE) == (0x50, 250_000)
    code = {rate: code for rate, (code, _) in witmotion.RATES.items()}
    assert code == {10: 0x06, 20: 0x07, 50: 0x08, 100: 0x09, 200: 0x0B}
    cutoff = {0: 256, 1: 188, 2: 98, 3: 42, 4: 20, 5: 10, 6: 5}  # Hz of a code of BANDWIDTH
    for rate, (_, bandwidth) in witmotion.RATES.items():  # the widest that ends below half the rate, or the narrowest
        assert bandwidth == min((b for b in cutoff if cutoff[b] < rate / 2), default=6)


def test_witmotion_filter_delays_match_its_chip() -> None:
    late = {1: 1.88, 2: 2.88, 3: 4.88, 4: 8.87, 5: 16.83, 6: 32.48}  # ms of A_DLPFCFG
    assert {number: 1e3 * delay for number, delay in witmotion.DELAY.items()} == pytest.approx(late)
    assert witmotion.filter_delay(100) == pytest.approx(4.88e-3)


def test_witmotion_commands_match_data_sheet() -> None:
    unlock = bytes.fromhex("ff aa 69 88 b5")
    written = [bytes.fromhex("ff aa" + rest) for rest in ("02 02 00", "1f 03 00", "03 09 00")]
    assert witmotion.settings(100) == tuple(command for value in written for command in (unlock, value))
    assert witmotion.write_register(0x1F, 0x1234) == bytes.fromhex("ff aa 1f 34 12")


def test_node_frames_match_documentation() -> None:
    """Two frames written out by hand: COBS, and CRC-16/CCITT-FALSE by binascii's table and by hand, docs/howto."""
    assert (node.WHO, node.START, node.STOP, node.SCAN, node.HELLO) == (0x81, 0x82, 0x83, 0x01, 0x02)
    assert node.NO_TEMPERATURE == -32768
    assert node.encode_command(node.WHO) == by_hand(bytes([0x81]))
    assert node.encode_command(node.START, 62.5) == by_hand(bytes.fromhex("82 24f40000"))
    scan = node.NodeScans(
        np.array([[1, -2, 0x01020304]], np.int32),
        np.array([0xABCD], np.uint32),
        np.array([1_000_000], np.uint32),
        np.array([2150], np.int16),
    )
    content = bytes.fromhex("01 cdab0000 40420f00 01000000 feffffff 04030201 6608")
    assert node.encode_scans(scan) == by_hand(content)
    assert node.SCAN_SIZE == 27
    hello = node.Hello(product="adxl355", serial="N1", axes=(0, 2), scale=0.5, rate=1000.0)
    text = b"adxl355".ljust(12, b"\0") + b"N1".ljust(12, b"\0")
    assert node.encode_hello(hello) == by_hand(b"\x02\x01" + text + bytes.fromhex("05 0000003f 40420f00"))


def by_hand(content: bytes) -> bytes:
    """Return a frame by the code of docs/howto/rig/node.md, a bit and a byte at a time."""
    crc = 0xFFFF
    for byte in content:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    parts = (content + bytes([crc & 0xFF, crc >> 8])).split(b"\0")
    return b"".join(bytes([len(part) + 1]) + part for part in parts) + b"\0"


def test_can_identifier_flags_match_linux() -> None:
    assert (frames.EXTENDED, frames.REMOTE, frames.NUMBER) == (0x8000_0000, 0x4000_0000, 0x1FFF_FFFF)


def test_slcan_commands_match_manual() -> None:
    bit_rates = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000]
    assert {rate: b"S%d\r" % k for k, rate in enumerate(bit_rates)} == slcan.BITRATES
    assert (slcan.OPEN, slcan.CLOSE, slcan.NO_STAMPS) == (b"O\r", b"C\r", b"Z0\r")
    assert (slcan.END, slcan.REFUSED) == (13, 7)
