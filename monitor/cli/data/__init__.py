"""Commands on measurements, modes, structures and diagnoses."""
