"""Single causes: how often they are named, and how accurately."""
