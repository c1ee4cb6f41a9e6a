"""Runs, results and services for tests."""
