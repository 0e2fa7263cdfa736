"""Events compared with frames, and events alone."""
