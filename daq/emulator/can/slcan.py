"""An SLCAN adapter on a pty, with emulated nodes on its bus."""

import os
import select
import threading
from collections.abc import Sequence

from daq.emulator.can.sync import synced_frames
from daq.emulator.serving import NO_SYNCS, PORT_BUFFER, EmulatedBusNode, Frame, Pty
from daq.protocol import slcan
from daq.protocol.frames import can_frames, concatenate

_LINE_END = b"\r"
_LONGEST = 64
_ROOM_MS = 20  # that the thread waits for room before it looks whether it is unplugged
_FRAMES = {ord("t"): b"z\r", ord("r"): b"z\r", ord("T"): b"Z\r", ord("R"): b"Z\r"}  #: line -> answer
_ANSWERS = {ord("V"): b"V1013\r", ord("N"): b"N0042\r", ord("F"): b"F00\r"}
_SETTINGS = b"SsZXWMmAPYQ"


class EmulatedSlcan(Pty):
    """The device side of an adapter.

    Frames sent before the channel is open are lost, as on a bus without a receiver. The adapter never waits for a
    reader: beyond the buffer of the pty it holds as many bytes as the kernel buffers for a real port, and then drops
    whole scans, which the node counts. A thread forwards the held bytes as soon as there is room: the nodes of a bus
    fill a pty (4 to 18 kB) within some 10 ms at ten times real time, and are not served that often on a busy machine.

    Parameters
    ----------
    nodes : on its bus
    """

    def __init__(self, nodes: Sequence[EmulatedBusNode]) -> None:
        super().__init__()
        self.nodes = nodes
        self._open, self._commands = False, bytearray()
        self._changed = threading.Condition()  # guards the pending bytes
        self._pump = threading.Thread(target=self._hand_on, name=f"adapter {self.port}", daemon=True)
        self._pump.start()

    def close(self) -> None:
        """Unplug: the host's side reads an error from now on; once is enough."""
        if not self._unplugged:
            with self._changed:
                self._unplugged = True
                self._changed.notify()
            self._pump.join()
            os.close(self._master)

    def serve(self) -> None:
        """Answer commands and send data that are due, without blocking. No effect once unplugged."""
        if self._unplugged:
            return
        with self._changed:
            self._listen()
            for node in self.nodes:
                self._send(node.beats())
            self._sample()
            self._drain()
            if self._pending:
                self._changed.notify()

    def _listen(self) -> None:
        try:
            self._commands += os.read(self._master, 4096)
        except OSError:
            return  # no reply, or the port is not open
        *lines, rest = self._commands.split(_LINE_END)
        self._commands = rest[-_LONGEST:]
        for line in lines:
            self._obey(bytes(line))

    def _obey(self, line: bytes) -> None:
        command = line[0] if line else 0
        if command in _FRAMES:
            self._transmit(line, _FRAMES[command])
            return
        if command in (ord("O"), ord("L")):
            self._open = True
        elif command == ord("C"):
            self._open = False
        known = not line or command in b"OLC" or command in _SETTINGS
        self._pending += _ANSWERS.get(command, _LINE_END if known else bytes([slcan.REFUSED]))

    def _transmit(self, line: bytes, answer: bytes) -> None:
        frames = slcan.SlcanDecoder().feed(line + _LINE_END) if self._open else can_frames([])
        if not len(frames):
            self._pending.append(slcan.REFUSED)
            return
        self._pending += answer
        for can_id, data in frames:
            for node in self.nodes:
                self._send(node.receive(can_id, data))

    def _send(self, frames: list[Frame]) -> None:
        if frames and self._open:
            self._pending += slcan.encode(can_frames(frames))

    def _sample(self) -> None:
        room = max(0, PORT_BUFFER - len(self._pending)) // len(self.nodes) if self._open else 0
        syncs = next((found for node in self.nodes if (found := node.syncs()).n), NO_SYNCS)
        parts = {node: node.scans(room // node.bytes_a_scan, syncs) for node in self.nodes}
        frames = [part for node, part in parts.items() if not node.synced]
        if syncs.n and room:
            frames.append(synced_frames(syncs.n, [part for node, part in parts.items() if node.synced]))
        if any(map(len, frames)):
            arriving = concatenate(frames)
            for node in self.nodes:
                arriving = node.disturbed(arriving)
            self._pending += slcan.encode(arriving)

    def _hand_on(self) -> None:
        """Drain between servings, in a thread of its own, until unplugged."""
        room = select.poll()
        room.register(self._master, select.POLLOUT)
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._pending or self._unplugged)
                if self._unplugged:
                    return
            room.poll(_ROOM_MS)
            with self._changed:
                self._drain()
