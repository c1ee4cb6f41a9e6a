"""Test-analysis correlation: modes, residual forces, virtual sensors, sensor health."""
