"""Measured modes of many windows: tracked, averaged, checked, matched, freed from device delays."""
