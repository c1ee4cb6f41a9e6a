"""The virtual rig: a true structure, emulated devices and a timeline. It knows nothing of the analysis."""

from monitor.rig.play import PlayReport, play, run_rig
from monitor.rig.scenario import T_DEVICES, Scenario, draw_t_frame, dump_scenario, load_scenario
from monitor.rig.truth import World, make_sources

__all__ = [
    "T_DEVICES",
    "PlayReport",
    "Scenario",
    "World",
    "draw_t_frame",
    "dump_scenario",
    "load_scenario",
    "make_sources",
    "play",
    "run_rig",
]
