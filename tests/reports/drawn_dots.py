"""Dots of a still picture of a cloud, read back from its SVG."""

import re

import numpy as np


def dots_of(svg: str, attributes: str) -> set[tuple[int, int]]:
    """The places of all dots with these attributes, half px."""
    places = set()
    for path in re.findall(f'{attributes} d="([^"]*)"', svg):
        steps = np.array(re.findall(r"m(-?\d+) ?(-?\d+)h0", path), dtype=int)
        places |= set(map(tuple, np.cumsum(steps, axis=0).tolist()))
    return places
