"""Commands `demo` and `rig`: a virtual rig, its monitor, and the truth compared with the answer."""
