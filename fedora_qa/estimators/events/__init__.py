"""Events against frames, and by themselves."""
