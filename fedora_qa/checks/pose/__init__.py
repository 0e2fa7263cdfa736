"""The poses by themselves."""
