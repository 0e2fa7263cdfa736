"""Places built in code: what stands where, as textured triangles."""
