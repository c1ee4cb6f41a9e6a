"""Identities of modes over time and over set-ups."""
