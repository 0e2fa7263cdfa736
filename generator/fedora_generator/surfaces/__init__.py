"""The exact world: planar faces with closed-form textures, seen by a pinhole camera in float64."""
