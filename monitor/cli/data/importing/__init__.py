"""Command `import`: files of measurements, and of CAN traffic, to logs."""
