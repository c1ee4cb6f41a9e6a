"""The virtual rig: a true structure, emulated devices and a timeline; independent of the analysis."""

from monitor.rig.device_model import DeviceSource, make_sources
from monitor.rig.player import Place, PlayReport, play
from monitor.rig.process import run_rig
from monitor.rig.random_scenario import T_DEVICES, draw_t_frame
from monitor.rig.scenario import RigDevice, RigEvent, Scenario, Truth, dump_scenario, load_scenario, shipped_scenarios
from monitor.rig.world import World, true_structure

__all__ = [
    "T_DEVICES",
    "DeviceSource",
    "Place",
    "PlayReport",
    "RigDevice",
    "RigEvent",
    "Scenario",
    "Truth",
    "World",
    "draw_t_frame",
    "dump_scenario",
    "load_scenario",
    "make_sources",
    "play",
    "run_rig",
    "shipped_scenarios",
    "true_structure",
]
