"""The log sensor in the exact world: between two events, only the samples that locate them are rendered."""

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.adaptive.camera_path import CameraPath, camera_paths, plan_tiles
from fedora_generator.adaptive.crossing_kernels import DEEPEST, NO_ROOM, NOT_FINITE, Care, Clock, follow_tiles
from fedora_generator.adaptive.light_kernels import Sensor, scratch_for
from fedora_generator.camera import Camera
from fedora_generator.events.comparator import SignalNotFiniteError
from fedora_generator.events.keys import KeyLayout
from fedora_generator.events.sensor import Pixels
from fedora_generator.flight import Flight
from fedora_generator.render import ExactWorld
from fedora_generator.sampling import Fidelity
from fedora_generator.threads import in_threads, thread_count
from fedora_qa.conventions import NS_PER_S, NS_PER_US, US_PER_S

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]

FIRST_CAPACITY: Final = 1 << 11
"""Events of a tile and interval: 8 a pixel. Where there are more, the tile is computed again."""

TILE_STRIDE: Final = 64
"""From a tile to the next in the order in which threads take them."""


@dataclass(slots=True)
class Follower:
    """Finds the events of an interval of the flight; each tile is sampled as densely as its own motion requires."""

    world: ExactWorld
    camera: Camera
    flight: Flight
    fidelity: Fidelity
    tick_ns: int = NS_PER_US
    """Unit of the timestamps"""
    rendered_pixels: int = 0
    """So far"""

    def crossings(self, pixels: Pixels, start_ns: int, stop_ns: int) -> Keys:
        """Sorted keys (``events/keys.py``) of the events in (start, stop], nanoseconds of the flight's clock.

        Raises
        ------
        SignalNotFiniteError
            A pixel has no logarithm; it is left in the signal.
        """
        paths = camera_paths(self.world, self.camera, self.flight, start_ns, stop_ns)
        return np.sort(np.concatenate([self._path_crossings(path, pixels) for path in paths]))

    def _path_crossings(self, path: CameraPath, pixels: Pixels) -> Keys:
        """Keys of the events along one path; its scratch space and its room for keys are free afterwards."""
        start_ns = path.start_ns - pixels.origin_ns  # the sensor counts from the start of the recording
        height, width = pixels.signal.shape
        layout, faces = KeyLayout(height, width), self.world.initial_faces
        plan = plan_tiles(faces, path, height, width, self.fidelity.motion_px)
        levels = (pixels.reference, pixels.signal, pixels.threshold_on, pixels.threshold_off)
        sensor = Sensor(*levels, pixels.log_eps_dn, pixels.leak_per_s, start_ns / NS_PER_S)
        care = Care(self.fidelity.caution, self.fidelity.tolerance_us / US_PER_S)
        span_ns = path.stop_ns - path.start_ns
        clock = Clock(start_ns, span_ns, self.tick_ns, layout.column_bits, layout.timestamp_shift)
        scratch = scratch_for(
            threads=thread_count(),
            faces=int(np.diff(plan.face_starts).max()),
            waves=self.world.textures.waves.shape[1],
            samples=int(plan.samples.max()),
            entries=path.coefficients.shape[1],
            depth=DEEPEST,
        )
        stage = (
            self.world.textures,
            self.world.grey,
            faces.frames,
            faces.bodies,
            path.coefficients,
            sensor,
            care,
            clock,
        )
        # Threads take equal shares of this order. Neighbouring tiles take about as much time, distant ones do not: the
        # stride spreads each share over the image.
        tiles = np.concatenate([np.arange(first, plan.samples.size, TILE_STRIDE) for first in range(TILE_STRIDE)])
        rows, capacity = [np.empty(0, np.int64)], FIRST_CAPACITY
        while tiles.size:
            keys, counts = np.empty((tiles.size, capacity), np.int64), np.empty(tiles.size, np.int64)
            plan_arrays = (plan.samples, plan.face_starts, plan.faces)
            follow = partial(follow_tiles, *stage, tiles, *plan_arrays, scratch, keys, counts)
            self.rendered_pixels += sum(in_threads(follow, tiles.size))
            if (counts == NOT_FINITE).any():
                raise SignalNotFiniteError("Expected finite signals, got one that is infinite or not a number")
            rows += [row[:count] for row, count in zip(keys, counts, strict=True) if count > 0]
            tiles, capacity = tiles[counts == NO_ROOM], 8 * capacity
        return np.concatenate(rows)
