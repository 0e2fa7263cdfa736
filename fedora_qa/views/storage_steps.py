"""The steps in which a file stores depth, flow, poses and IMU samples, from a few rows of each."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, SampledCurve, VectorSamples
from fedora_qa.estimators.storage.steps import depth_step, level_step, stored_step
from fedora_qa.layout.canonical import datasets_of_all, spec_of
from fedora_qa.layout.conversions import stored_part_of_pose
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.stored_step import DOUBLE_ROUNDOFF, StoredStep, of_components
from fedora_qa.views.motion_samples import sample_step

_PLACES: Final = (0.25, 0.5, 0.75)
"""Where images are read, as shares of the rows: the middle one of three steps is taken, so that one image that is zero,
or has a fault, does not decide. Where the first two agree they are the middle, and the third is not read."""

_FEWEST_LEVELS: Final = 5
"""Least number of levels of a component of flow that show a step."""

_MOST_VALUES: Final = 4096
"""Values of a component that are read of an image, and samples of a motion: hundreds suffice for any probability."""

_MOTIONS: Final[Mapping[str, tuple[str, ...]]] = {
    "pose": ("path/pose/position", "path/pose/orientation"),
    "imu": ("path/imu/angular_velocity", "path/imu/linear_acceleration"),
}


def stored_steps(sequence: SequenceRows, facts: Facts, streams: Collection[str]) -> dict[str, StoredStep]:
    """Infer the steps of the values of streams from rows that follow from the file alone.

    Parameters
    ----------
    sequence
        The open file, or a view of it.
    facts
        With clocks and sizes.
    streams
        Streams whose steps are needed; others are not read.

    Returns
    -------
    dict
        By key of the dataset, in its canonical unit; datasets that cannot be read have none.
    """
    images = [spec.key for spec in datasets_of_all(streams) if spec.dtype == "float32"]
    steps: dict[str, StoredStep] = {}
    for key in images:
        in_places: list[StoredStep] = []
        for step in _image_steps(sequence, facts, key):
            if step in in_places:
                in_places = [step]
                break
            in_places.append(step)
        if in_places:
            # The middle one of each component alone: one image may show the step of u, and another that of v.
            count = max(1, *(len(step.components) for step in in_places))
            parts = [[step.component(i) for step in in_places] for i in range(count)]
            middles = [sorted(part, key=lambda step: (step.size, step.roundoff))[len(part) // 2] for part in parts]
            steps[key] = of_components(middles) if count > 1 else middles[0]
    for stream in ("pose", "imu"):
        if stream in streams and stream in facts.clocks:
            for key in _MOTIONS[stream]:
                if of_motion := _motion_step(sequence, facts, stream, key):
                    steps[key] = of_motion
    return steps


def _image_steps(sequence: SequenceRows, facts: Facts, key: str) -> Iterator[StoredStep]:
    count = facts.sizes.get(key, 0)
    for row in sorted({min(int(place * count), count - 1) for place in _PLACES} if count else ()):
        try:
            image = sequence.rows(key, row, row + 1)[0]
        except UnreadableRowsError:  # a finding of integrity.readable
            continue
        scale = sequence.layout.bindings[key].scale
        yield image_step(image if scale == 1 else image / scale).scaled(scale)


def image_step(image: NDArray[np.floating]) -> StoredStep:
    """Return the step of the values (H, W) or (H, W, k) of an image; of depths (H, W) also that of their inverses."""
    # Depth has no axis of components.
    values = image.reshape(image.shape[0] * image.shape[1], -1)
    values = values[:: max(1, len(values) // _MOST_VALUES)].astype(np.float64)
    step = stored_step(values)
    if image.ndim == 2 and not step.is_coarse and (of_depth := depth_step(image)):
        return replace(of_depth.grid, roundoff=step.roundoff, typical=step.typical)
    if image.ndim == 2:
        return step
    # Flow of a coarse step has few levels. Two or three may be that of as many walls.
    parts = []
    for i, component in enumerate(values.T):
        part, finite = step.component(i), component[np.isfinite(component)]
        few = not part.size and len(np.unique(finite)) >= _FEWEST_LEVELS
        size = level_step(finite) if few else 0.0
        parts.append(replace(part, size=size, is_identifiable=True) if size else part)
    return of_components(parts)


def _motion_step(sequence: SequenceRows, facts: Facts, stream: str, key: str) -> StoredStep | None:
    """Return the step of samples in the middle of the file; None where they cannot be read."""
    times_ns = facts.clocks[stream].times_ns
    start = max(0, (len(times_ns) - _MOST_VALUES) // 2)
    stop = min(start + _MOST_VALUES, facts.sizes.get(key, 0))
    try:
        values = sequence.rows(key, start, stop).astype(np.float64)
        scale, conversion = sequence.layout.bindings[key].scale, sequence.layout.bindings[key].conversion
        is_of_another_frame = conversion is not None and conversion.name == "position_quaternion"
        if conversion is not None and is_of_another_frame:
            # Values of the body have no grid: it is that of the frame whose poses are stored.
            positions, quaternions = (
                sequence.rows(part, start, stop).astype(np.float64) / sequence.layout.bindings[part].scale
                for part in _MOTIONS["pose"]
            )
            values = stored_part_of_pose(positions, quaternions, key, conversion) * scale
    except (UnreadableRowsError, KeyError):
        return None
    kept = facts.clocks[stream].advancing[start:stop] & np.isfinite(values).all(axis=1)
    if key.endswith("orientation"):
        kept &= np.any(values != 0, axis=1)
    values = values[kept] / scale
    curve: SampledCurve = OrientationSamples(values) if key.endswith("orientation") else VectorSamples(values)
    step = sample_step(times_ns[start:stop][kept], values, curve).scaled(scale)
    if is_of_another_frame:
        # A rotation mixes components: each has the noise of the coarsest.
        step = replace(step, size=max(step.component(i).size for i in range(values.shape[1])), components=())
    return step


def inferred_steps(facts: Facts) -> dict[str, str | float]:
    """Return the steps in words, as the record states them: ``storage.depth`` is ``1 mm``."""
    return {
        f"storage.{key.removeprefix('path/').replace('/', '.')}": step.text(spec_of(key).units)
        for key, step in facts.steps.items()
        if step.size or step.inverse or step.roundoff > DOUBLE_ROUNDOFF
    }
