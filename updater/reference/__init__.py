"""The reference: calibrated model, expansion of measured modes, pairing with model modes."""
