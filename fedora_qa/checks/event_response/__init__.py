"""Events against the logarithmic intensity of the frames."""
