"""Tests, their support and the independent examiner."""
