"""Everything wired: the monitoring loop, the virtual rig, the viewer and the command line."""
