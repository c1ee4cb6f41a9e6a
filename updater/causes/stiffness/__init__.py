"""Causes that change the stiffness."""
