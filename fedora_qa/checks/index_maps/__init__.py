"""The maps from frames to events."""
