"""Alignment of the images of different cameras, by their declared positions and directions."""
