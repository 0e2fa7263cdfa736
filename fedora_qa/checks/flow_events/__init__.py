"""Flow against events."""
