"""The independent examiner: specimens, sensors and signals by a code of its own."""
