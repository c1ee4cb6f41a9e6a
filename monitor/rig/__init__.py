"""The virtual rig: a true structure, emulated devices and a timeline; independent of the analysis."""

from monitor.rig.device_model import DeviceSource as DeviceSource
from monitor.rig.device_model import make_sources as make_sources
from monitor.rig.player import Place as Place
from monitor.rig.player import PlayReport as PlayReport
from monitor.rig.player import play as play
from monitor.rig.process import run_rig as run_rig
from monitor.rig.random_scenario import T_DEVICES as T_DEVICES
from monitor.rig.random_scenario import draw_t_frame as draw_t_frame
from monitor.rig.scenario import RigDevice as RigDevice
from monitor.rig.scenario import RigEvent as RigEvent
from monitor.rig.scenario import Scenario as Scenario
from monitor.rig.scenario import Truth as Truth
from monitor.rig.scenario import dump_scenario as dump_scenario
from monitor.rig.scenario import load_scenario as load_scenario
from monitor.rig.scenario import shipped_scenarios as shipped_scenarios
from monitor.rig.world import World as World
from monitor.rig.world import true_structure as true_structure
