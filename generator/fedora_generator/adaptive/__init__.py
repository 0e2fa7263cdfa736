"""Events of the exact world, sampled pixel by pixel only where and when its light demands it."""
