"""Checks of optical flow: against frames, against depth and pose, and rate against rate."""
