"""Files of measurements of other programs: read into recordings, and written."""
