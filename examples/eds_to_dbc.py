"""A DBC file for the driver can-dbc from the EDS file of a CANopen sensor: the frames of its transmit PDOs.

    python eds_to_dbc.py SENSOR.eds NODE > SENSOR.dbc

An EDS file states no unit and no counter: give `scale` in the settings, and name the object that counts scans. The PDOs
are those of the EDS file; a sensor whose mapping was changed sends others.
"""

import re
import sys
from pathlib import Path

from canopen import import_od
from canopen.objectdictionary import FLOAT_TYPES, SIGNED_TYPES, ODRecord
from cantools.database import Database
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion

MAPPING, COMMUNICATION, N_PDOS, DISABLED = 0x1A00, 0x1800, 512, 1 << 31
arguments = sys.argv[1:] if __name__ == "__main__" else []
file, node = arguments or (str(Path(__file__).parent / "accelerometer.eds"), "5")
objects = import_od(file, int(node))

messages = []
for number in range(N_PDOS):
    if MAPPING + number not in objects or COMMUNICATION + number not in objects:
        continue
    mapping, communication = objects[MAPPING + number], objects[COMMUNICATION + number]
    assert isinstance(mapping, ODRecord)
    assert isinstance(communication, ODRecord)
    identifier, start, signals = communication[1].default or 0, 0, []
    if identifier & DISABLED:
        continue
    for sub in range(1, 1 + (mapping[0].default or 0)):
        mapped = mapping[sub].default or 0  # object, part of it, bits
        index, part, bits = mapped >> 16, mapped >> 8 & 0xFF, mapped & 0xFF
        found = objects[index]
        variable = found[part] if isinstance(found, ODRecord) else found
        name = re.sub(r"\W+", "_", str(getattr(variable, "name", f"object_{index:04X}")))
        kind = getattr(variable, "data_type", None)
        conversion = BaseConversion.factory(is_float=kind in FLOAT_TYPES)
        signals.append(Signal(name, start, bits, is_signed=kind in SIGNED_TYPES, conversion=conversion))
        start += bits
    if signals:
        messages.append(Message(identifier & 0x7FF, f"TPDO{number + 1}", (start + 7) // 8, signals))

dbc = str(Database(messages=messages).as_dbc_string())
if arguments:
    print(dbc)
