"""IMU samples and poses."""
