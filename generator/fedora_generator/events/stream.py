"""The event stream: light through the sensor into the file.

In the exact world the log sensor follows the light pixel by pixel (``adaptive/``). Everything else takes images, as
densely as motion or the scene requires (``sampling``).
"""

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_generator.adaptive.follower import Follower
from fedora_generator.camera import event_camera
from fedora_generator.choices import Quality
from fedora_generator.events.keys import EventBatch
from fedora_generator.events.sensor import EventSensor, follows_light
from fedora_generator.render import ExactWorld
from fedora_generator.rendered_world import RenderedWorld
from fedora_generator.sampling import FIDELITY, MOTION_BOUND_PX, FixedSteps, MotionSteps, Sampling
from fedora_generator.scene import Scene
from fedora_generator.write import EventColumns, IndexMap, write_camera, write_dataset, write_events
from fedora_qa.conventions import NS_PER_US


class EventRecorder:
    """Runs the event camera along the flight; ``run_to`` ever later times, then ``finish``.

    ``maps`` are the index maps to write: from the key of a dataset to the name of its size and the timestamps (n,), us,
    of its frames.
    """

    def __init__(
        self,
        file: h5py.File,
        scene: Scene,
        world: RenderedWorld,
        quality: Quality,
        maps: dict[str, tuple[str, NDArray[np.int64]]],
        seed: np.random.SeedSequence,
    ) -> None:
        self._file = file
        self._world = world
        self._camera = event_camera(scene.camera)
        self._flight = scene.fly()
        # Only the exact world gives light at all times, through a pinhole; a fixed grid of times needs images.
        self._follower: Follower | None = None
        is_followed = not scene.event_step_us and self._camera.lens is None and follows_light(scene.events)
        if is_followed and isinstance(world, ExactWorld):
            self._follower = Follower(world, self._camera, self._flight, FIDELITY[quality])
        self._sampling: Sampling
        if scene.event_step_us:
            self._sampling = FixedSteps(scene.event_step_us)
        else:
            self._sampling = MotionSteps(world, self._camera, self._flight, MOTION_BOUND_PX[quality])
        self._sensor = EventSensor(scene.events, self._camera.height, self._camera.width, seed)
        self._columns = EventColumns(file)
        self._maps = {key: (size, IndexMap(timestamps)) for key, (size, timestamps) in maps.items()}
        self._now_us = 0
        write_camera(file, "events", self._camera)
        write_events(file, scene, self._sensor.hot_pixels)
        self._sensor.start(0, self._luma_dn(0))

    @property
    def events(self) -> int:
        """Events recorded so far."""
        return self._columns.rows

    def run_to(self, stop_us: int) -> None:
        """Record the events up to and including ``stop_us``."""
        if stop_us == self._now_us:
            return
        if self._follower is not None:
            self._keep(self._sensor.follow(stop_us * NS_PER_US, self._follower))
        else:
            for time_us in self._sampling.times_us(self._now_us, stop_us).tolist():
                self._keep(self._sensor.advance(time_us * NS_PER_US, self._luma_dn(time_us)))
        self._now_us = stop_us

    def finish(self) -> None:
        """Write the last events, and the index maps."""
        self._keep(self._sensor.finish())
        self._columns.finish()
        for key, (size, index_map) in self._maps.items():
            indices = index_map.finish()
            write_dataset(self._file, key, indices, **{size: len(indices)})

    def _keep(self, batch: EventBatch) -> None:
        self._columns.append(batch)
        for _, index_map in self._maps.values():
            index_map.append(batch.t_us)

    def _luma_dn(self, time_us: int) -> NDArray[np.float64]:
        return self._world.at(time_us).luma_dn(self._camera, self._camera.pose_at(self._flight, time_us))
