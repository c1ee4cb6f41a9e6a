"""Device clocks and sampling times: from arrival times to one time grid."""
