"""Checks of pose and IMU."""
