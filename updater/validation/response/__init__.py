"""Response where there is no sensor: modal forces, Kalman filter of modes, standard deviations."""
