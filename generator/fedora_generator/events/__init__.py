"""The event camera: light in, events out, and everything that a real sensor adds."""
