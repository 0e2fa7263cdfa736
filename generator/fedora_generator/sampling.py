"""When to render for the event camera.

Between two renders the sensor takes the logarithm of the luminance as a straight line, so the image must not move far
from one to the next. Over each frame interval the largest displacement of any pixel of the event camera is computed
from depth and flight, forwards from its start and backwards from its end, and the interval is cut into as many equal
steps as keep a step under the bound. The sky counts, as it turns with the camera. There are two steps at least, so that
events of a slow flight are not those of interpolated frames.
"""

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.camera import Camera
from fedora_generator.choices import Quality
from fedora_generator.flight import Flight
from fedora_generator.flow import scene_flow_px
from fedora_generator.rendered_world import RenderedWorld

MOTION_BOUND_PX: Final[dict[Quality, float]] = {"draft": 1.0, "standard": 0.5, "reference": 0.1}
"""Image motion between two renders, px of the event camera."""

FEWEST_STEPS: Final = 2
"""Steps between two frames: more than the frames themselves."""

SHORTEST_STEP_US: Final = 10
"""A point that passes close to the camera has no bound; more than 100 000 renders a second are never made."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fidelity:
    """How closely events follow the exact world (``adaptive/``).

    Attributes
    ----------
    motion_px
        Image motion between two samples of a tile, px of the event camera. A pixel averages over its own width, so
        that nothing passes through it within one pixel of motion: at half a pixel, two samples show it.
    caution
        Factor on the curvature of a parabola between samples.
    tolerance_us
        Largest correction of a crossing that is not rendered again.
    """

    motion_px: float
    caution: float
    tolerance_us: float


FIDELITY: Final[dict[Quality, Fidelity]] = {
    "draft": Fidelity(motion_px=1.0, caution=4.0, tolerance_us=100.0),
    "standard": Fidelity(motion_px=0.5, caution=32.0, tolerance_us=20.0),
    "reference": Fidelity(motion_px=0.25, caution=64.0, tolerance_us=1.0),
}


class Sampling(Protocol):
    """Chooses the instants of the event renders."""

    def times_us(self, start_us: int, stop_us: int) -> NDArray[np.int64]:
        """Instants (n,) in (start, stop], whole microseconds, ascending; the last is ``stop_us``."""


@dataclass(frozen=True, slots=True)
class FixedSteps:
    """Renders on a fixed grid from time 0, as a game engine makes them."""

    step_us: int

    def times_us(self, start_us: int, stop_us: int) -> NDArray[np.int64]:
        """Multiples of the step in (start, stop]; and ``stop_us``."""
        first = (start_us // self.step_us + 1) * self.step_us
        return np.append(np.arange(first, stop_us, self.step_us, dtype=np.int64), stop_us)


@dataclass(frozen=True, slots=True)
class MotionSteps:
    """As many equal steps as keep the image motion of each under ``bound_px``."""

    world: RenderedWorld
    camera: Camera
    flight: Flight
    bound_px: float

    def times_us(self, start_us: int, stop_us: int) -> NDArray[np.int64]:
        """Equal steps from start to stop, two at least, rounded to whole microseconds."""
        steps = math.ceil(self.largest_motion_px(start_us, stop_us) / self.bound_px)
        steps = max(1, min(max(steps, FEWEST_STEPS), (stop_us - start_us) // SHORTEST_STEP_US))
        return start_us + (stop_us - start_us) * np.arange(1, steps + 1, dtype=np.int64) // steps

    def largest_motion_px(self, start_us: int, stop_us: int) -> float:
        """Largest displacement of any pixel between two instants; points that pass behind the camera do not count."""
        return max(self._largest_px(start_us, stop_us), self._largest_px(stop_us, start_us))

    def _largest_px(self, from_us: int, to_us: int) -> float:
        pose, to_pose = (self.camera.pose_at(self.flight, time_us) for time_us in (from_us, to_us))
        world = self.world.at(from_us)
        inverse_depth, bodies = world.inverse_depth_per_m(self.camera, pose), world.visible_bodies(self.camera, pose)
        flow = scene_flow_px(world, self.camera, inverse_depth, bodies, (pose, to_pose), (from_us, to_us))
        u, v = np.moveaxis(flow, -1, 0)
        return float(np.nanmax(np.hypot(u, v), initial=0.0))
