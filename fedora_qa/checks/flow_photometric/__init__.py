"""Flow against the colour frames."""
