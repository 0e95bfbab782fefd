"""Rear LiDAR and IMU from the short drive of a calibration session."""
