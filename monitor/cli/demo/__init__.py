"""The demo: a virtual rig, its monitor, and the truth compared with the answer."""
