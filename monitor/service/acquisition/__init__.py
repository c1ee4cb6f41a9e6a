"""Devices and thermometers of a running site."""
