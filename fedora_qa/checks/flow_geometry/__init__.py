"""Flow against depth, intrinsics and camera motion."""
