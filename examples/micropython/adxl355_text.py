"""Lines of text for the driver serial-text: an ADXL355 on I2C, 125 scans per second, as main.py of a Pico or ESP32.

    $counter,x,y,z*hh        x, y, z in counts of 3.9e-6 g; hh: exclusive or of the characters between $ and *

The scans wait in the memory of the sensor for up to 0.25 s. Scans that are lost all the same are counted.

    text = {columns = ["counter", "x", "y", "z"], scale = 3.83072e-5}
"""

import time

from machine import I2C, Pin

SENSOR = 0x1D  # 0x53 if ASEL is high
PERIOD_US = 8000
ODR_125_HZ = 0x05  # low-pass filter at 31.25 Hz
DEVICE_ID, STATUS, FIFO_ENTRIES, FIFO_DATA = 0x00, 0x04, 0x05, 0x11
FILTER, RANGE, POWER, RESET = 0x28, 0x2C, 0x2D, 0x2F
FIFO_OVERRUN, IS_X, IS_EMPTY = 0x04, 0x01, 0x02

bus = I2C(0, scl=Pin(5), sda=Pin(4), freq=400_000)


def axis(content: bytes, at: int) -> int:
    """Return one axis of a scan: 20 bits, the highest first."""
    bits = content[at] << 12 | content[at + 1] << 4 | content[at + 2] >> 4
    return bits - (1 << 20) if bits & 1 << 19 else bits


def send(counter: int, content: bytes) -> None:
    """Send the line of a scan."""
    text = f"{counter},{axis(content, 0)},{axis(content, 3)},{axis(content, 6)}"
    total = 0
    for character in text:
        total ^= ord(character)
    print(f"${text}*{total:02X}")


def start() -> None:
    """Wait for the sensor and let it measure up to 2 g."""
    while SENSOR not in bus.scan() or bus.readfrom_mem(SENSOR, DEVICE_ID, 1)[0] != 0xAD:
        print("# no ADXL355 found")
        time.sleep_ms(1000)
    for register, value in ((RESET, 0x52), (RANGE, 0x81), (FILTER, ODR_125_HZ), (POWER, 0x00)):
        bus.writeto_mem(SENSOR, register, bytes([value]))
        time.sleep_ms(10)


def run() -> None:
    """Send scans for good."""
    counter, last = 0, time.ticks_us()
    while True:
        overrun = bus.readfrom_mem(SENSOR, STATUS, 1)[0] & FIFO_OVERRUN
        waiting = bus.readfrom_mem(SENSOR, FIFO_ENTRIES, 1)[0] // 3
        now = time.ticks_us()
        if overrun:
            counter += max(time.ticks_diff(now, last) // PERIOD_US - waiting, 1)
        content = bus.readfrom_mem(SENSOR, FIFO_DATA, 9) if waiting else b"\0\0\2"
        if content[2] & IS_EMPTY or not content[2] & IS_X:
            time.sleep_ms(2)
            continue
        last = time.ticks_add(now, -(waiting - 1) * PERIOD_US)  # when it was taken; to send it may take long
        send(counter, content)
        counter += 1


start()
run()
