import os
import signal
import subprocess
import sys

from daq.signals import signal_event

FLOOD = """
import os, subprocess, sys
from signal import SIGUSR1
from daq.signals import signal_event
send = "import os, sys\\nfor _ in range(4000): os.kill(int(sys.argv[1]), 10)"
with signal_event(SIGUSR1) as seen:
    sender = subprocess.Popen([sys.executable, "-c", send, str(os.getpid())])
    n = 0
    while sender.poll() is None:
        if seen.wait(1e-5):
            seen.clear()
            n += 1
    assert sender.returncode == 0
    print(n)
"""


def test_signals_at_any_moment_of_waiting_set_the_event() -> None:
    """A handler that sets the event itself stops for ever where it interrupts `wait` inside its lock."""
    done = subprocess.run([sys.executable, "-c", FLOOD], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 1


def test_nested_contexts_see_their_own_signals() -> None:
    before = signal.getsignal(signal.SIGHUP)
    with signal_event(signal.SIGTERM, signal.SIGINT) as stop, signal_event(signal.SIGHUP) as reload:
        os.kill(os.getpid(), signal.SIGHUP)
        assert reload.wait(10.0)
        assert not stop.is_set()
        reload.clear()
        os.kill(os.getpid(), signal.SIGTERM)
        assert stop.wait(10.0)
        assert not reload.is_set()
    assert signal.getsignal(signal.SIGHUP) is before
