"""A DBC file for the driver can-dbc from the EDS file of a CANopen sensor: the frames of its transmit PDOs.

    python eds_to_dbc.py SENSOR.eds NODE > SENSOR.dbc

An EDS file states no unit and no counter: give `scale` in the settings, and name the object that counts scans. The PDOs
are those of the EDS file, or of a DCF file; a sensor whose mapping was changed sends others.
"""

import re
import sys
from pathlib import Path

from canopen import import_od
from canopen.objectdictionary import FLOAT_TYPES, SIGNED_TYPES, ODArray, ODRecord, ODVariable
from cantools.database import Database
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion

MAPPING, COMMUNICATION, N_PDOS, DISABLED = 0x1A00, 0x1800, 512, 1 << 31
arguments = sys.argv[1:] if __name__ == "__main__" else []
file, node = arguments or (str(Path(__file__).parent / "accelerometer.eds"), "5")
objects = import_od(file, int(node))


def stated(variable: ODVariable) -> int:
    """Return the value of an object: as configured (ParameterValue, in DCF files too), else its default."""
    return int(next((value for value in (variable.value, variable.default) if value is not None), 0))


messages = []
for number in range(N_PDOS):
    if MAPPING + number not in objects or COMMUNICATION + number not in objects:
        continue
    mapping, communication = objects[MAPPING + number], objects[COMMUNICATION + number]
    assert isinstance(mapping, ODRecord)
    assert isinstance(communication, ODRecord)
    identifier, start, signals = stated(communication[1]), 0, []
    if identifier & DISABLED:
        continue
    for sub in range(1, 1 + stated(mapping[0])):
        mapped = stated(mapping[sub])  # object, part of it, bits
        index, part, bits = mapped >> 16, mapped >> 8 & 0xFF, mapped & 0xFF
        found = objects.get(index)  # None: a file may map an object that it does not describe
        variable = found[part] if isinstance(found, (ODArray, ODRecord)) else found
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
