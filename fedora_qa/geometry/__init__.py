"""Mathematics of rotations, cameras and motion: arrays in, arrays out."""
