"""The IMU by itself and against the poses."""
