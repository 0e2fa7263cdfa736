"""Checks of the colour frames: repeats, order in time, channels, transfer curve, exposure."""
