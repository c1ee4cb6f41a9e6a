"""Layout of the viewer: blueprint and specifications of views."""
