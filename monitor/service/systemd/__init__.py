"""The service under systemd: unit file and notifications."""
