"""Servers in processes of their own: status page and live view."""
