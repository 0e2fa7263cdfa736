"""The plan of a corpus: which files it will hold. Nothing is written here."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_generator.camera import colour_camera, event_camera
from fedora_generator.choices import Quality
from fedora_generator.corpus.ladders import (
    SINGLE_SIZE_DIVISOR,
    Ladder,
    depends_on_pose_noise,
    ladder_of,
    magnitude_of,
    random_interval_s,
    random_magnitude_of,
    random_region,
    start_of,
    trials_of,
)
from fedora_generator.faults import (
    BYTE_FAULTS,
    FAULTS,
    FaultError,
    Region,
    allows_direction,
    allows_interval,
    allows_region,
)
from fedora_generator.faults.fault import default_unit
from fedora_generator.scene import Scene
from fedora_qa.errors import did_you_mean

Pair = tuple[str, str]
"""Cause and stream."""

TWO_AT_ONCE: Final[tuple[tuple[Pair, Pair], ...]] = (
    (("time_offset", "events"), ("gyro_bias", "imu")),
    (("time_offset", "imu"), ("time_offset", "rgb")),
    (("spatial_offset", "depth"), ("teleport", "pose")),
    (("flow_gain", "flow"), ("hot_pixels", "events")),
    (("frozen_frames", "rgb"), ("dropped_samples", "imu")),
    (("exposure_or_gamma", "rgb"), ("lever_arm", "pose")),
    (("polarity_inverted", "events"), ("flow_sign", "flow")),
    (("index_off_by_one", "depth_to_event"), ("unit_mm_m", "depth")),
    (("threshold_misdeclared", "events"), ("intrinsics_focal", "metadata")),
    (("clock_rate", "pose"), ("accel_bias", "imu")),
)
"""Composite faults, of different streams: some pairs have symptoms in common, others none."""

_PLACED: Final = frozenset(
    {
        "dropped_samples",
        "duplicated_samples",
        "unsorted",
        "frozen_frames",
        "swapped_frames",
        "nan_in_stream",
        "teleport",
    }
)
"""Faults at one place in time: confined to half of the time they are the same faults."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CorpusOptions:
    """What to make.

    Attributes
    ----------
    clean
        Clean sequences of each scene, with the seeds ``seed``, ``seed + 1``, ...
    causes
        Each ``cause`` or ``stream:cause`` as the table of faults has them; empty for all.
    ladder
        Rungs of each ladder.
    duration_s, quality
        Of every sequence.
    trials
        Magnitudes of each fault drawn from a range instead of a ladder, each in a sequence of its own; 0: ladders.
    deep, deep_trials
        Causes, as in ``causes``, that get more trials than the others, and how many.
    spread
        Whether sequences of a scene begin at different places of its flight. Where there is no noise, those of one
        scene are all alike otherwise.
    off_grid
        Whether trials draw sizes, directions of shifts, times and regions at random: sizes of no grid, shifts by parts
        of a pixel, and local faults as trials of their own.
    """

    clean: int = 2
    causes: tuple[str, ...] = ()
    ladder: int = 3
    duration_s: float = 1.0
    quality: Quality = "draft"
    seed: int = 0
    trials: int = 0
    deep: tuple[str, ...] = ()
    deep_trials: int = 60
    spread: bool = False
    off_grid: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedFault:
    """One fault of one file, as ``plant_fault`` takes it; ``donor`` is a clean file of the corpus."""

    cause: str
    stream: str
    magnitude: float | None
    unit: str
    seed: int
    start_s: float | None = None
    stop_s: float | None = None
    region: Region | None = None
    direction_deg: float | None = None
    donor: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedFile:
    """One file: clean where it has no faults, else a copy of ``base`` with them, planted in their order."""

    file: str
    scene: str
    seed: int
    start_s: float | None = None
    base: str | None = None
    faults: tuple[PlannedFault, ...] = ()
    observable: bool = False
    notes: str = ""


def plan_corpus(options: CorpusOptions, scenes: tuple[Scene, ...]) -> tuple[PlannedFile, ...]:
    """Return every file of the corpus: clean ones first, in an order that follows from the arguments alone.

    Each fault is planted in one clean sequence, the whole ladder in the same, or each trial in another; which one
    follows from the name of the fault, so that the same fault gets the same file whichever others are requested.

    Raises
    ------
    FaultError
        A cause that no fault has.
    """
    pairs, deep = _pairs_of(options.causes), _pairs_of(options.deep) if options.deep else ()
    clean = []
    for scene in scenes:
        for seed in range(options.seed, options.seed + options.clean):
            start_s = start_of(scene, seed, options.duration_s) if options.spread else None
            file = f"clean/{scene.name}-{seed}.h5"
            clean.append(PlannedFile(file=file, scene=scene.name, seed=seed, start_s=start_s))
    planner = _Planner(options, {scene.name: scene for scene in scenes}, tuple(clean))
    files = [*clean]
    for pair in pairs:
        trials = options.deep_trials if pair in deep else options.trials
        files += planner.trials(pair, trials) if options.trials else planner.ladder(pair)
        files += planner.local_trials(pair, trials) if options.off_grid else planner.local(pair)
    files += [planner.composite(first, second) for first, second in TWO_AT_ONCE if {first, second} <= {*pairs}]
    return tuple(files)


def _pairs_of(causes: tuple[str, ...]) -> tuple[Pair, ...]:
    table = (*FAULTS, *BYTE_FAULTS)
    names = {cause for cause, _ in table} | {f"{stream}:{cause}" for cause, stream in table}
    unknown = [cause for cause in causes if cause not in names]
    if unknown:
        legal = ", ".join(dict.fromkeys(cause for cause, _ in table))
        raise FaultError(
            f"Expected causes that can be planted, got {', '.join(unknown)}; choose from {legal}"
            f"{did_you_mean(unknown[0], sorted(names))}"
        )
    return tuple(
        (cause, stream) for cause, stream in table if not causes or cause in causes or f"{stream}:{cause}" in causes
    )


@dataclass(frozen=True, slots=True)
class _Planner:
    options: CorpusOptions
    scenes: dict[str, Scene]
    clean: tuple[PlannedFile, ...]

    def ladder(self, pair: Pair) -> Iterator[PlannedFile]:
        """Every rung, over the whole sequence."""
        base = self._base(pair)
        ladder = self._ladder(pair, base)
        for magnitude in ladder.rungs(self.options.ladder):
            fault = self._fault(pair, base, magnitude)
            yield _copy_of(base, "single", _label(fault), (fault,), ladder.is_observable(magnitude))

    def trials(self, pair: Pair, most: int) -> Iterator[PlannedFile]:
        """Magnitudes over a range, over the whole sequence, each in the next clean sequence."""
        number = _number(f"{pair}")
        bases = self._bases(pair)
        for trial in range(trials_of(self._ladder(pair, bases[0]), most)):
            base = bases[(number + trial) % len(bases)]
            ladder = self._ladder(pair, base)
            if self.options.off_grid:
                random = np.random.default_rng([number, trial])
                fault = self._random_fault(pair, base, random)
                magnitude = fault.magnitude
            else:
                magnitude = magnitude_of(ladder, trial, number / 2**32)
                fault = self._fault(pair, base, magnitude)
            fault = replace(fault, seed=_number(f"{pair}{magnitude} {trial}"))
            observable = ladder.is_observable(magnitude)
            yield _copy_of(base, "single", f"{_label(fault)}-trial{trial}", (fault,), observable)

    def local(self, pair: Pair) -> Iterator[PlannedFile]:
        """Plan a severe fault in the middle half of the time, and in the middle quarter of the image."""
        base = self._base(pair)
        ladder, fault = self._ladder(pair, base), self._severe(pair, base)
        quarter_s = self.options.duration_s / 4
        if allows_interval(*pair) and pair[0] not in _PLACED:
            half = replace(fault, start_s=quarter_s, stop_s=3 * quarter_s)
            observable = ladder.is_observable(fault.magnitude, share=1 / 2)
            yield _copy_of(base, "local", f"{_label(half)}-half", (half,), observable, "half of the time")
        if allows_region(*pair):
            camera_of = event_camera if pair[1] == "events" else colour_camera
            camera = camera_of(self.scenes[base.scene].camera)
            left, top = camera.width // 4, camera.height // 4
            part = replace(fault, region=(left, top, left + camera.width // 2, top + camera.height // 2))
            observable = ladder.is_observable(fault.magnitude, share=1 / 4)
            yield _copy_of(base, "local", f"{_label(part)}-quarter", (part,), observable, "a quarter of the image")

    def local_trials(self, pair: Pair, most: int) -> Iterator[PlannedFile]:
        """Magnitudes over a range, each in an interval at random and in a region at random, of another sequence."""
        number, bases = _number(f"{pair} local"), self._bases(pair)
        for trial in range(-(-most // SINGLE_SIZE_DIVISOR)):
            base = bases[(number + trial) % len(bases)]
            ladder, random = self._ladder(pair, base), np.random.default_rng([number, trial])
            fault = replace(self._random_fault(pair, base, random), seed=_number(f"{pair} local {trial}"))
            if allows_interval(*pair):
                start_s, stop_s = random_interval_s(random, self.options.duration_s)
                share = (stop_s - start_s) / self.options.duration_s
                interval = replace(fault, start_s=start_s, stop_s=stop_s)
                if pair[0] in _PLACED:  # a place in time, and no interval
                    share, interval = 1.0, replace(fault, start_s=start_s)
                observable = ladder.is_observable(fault.magnitude, share)
                name = f"{_label(interval)}-interval{trial}"
                yield _copy_of(base, "local", name, (interval,), observable, "at a random time")
            if allows_region(*pair):
                camera_of = event_camera if pair[1] == "events" else colour_camera
                camera = camera_of(self.scenes[base.scene].camera)
                left, top, right, bottom = random_region(random, camera.width, camera.height)
                part = replace(fault, region=(left, top, right, bottom))
                share = (right - left) * (bottom - top) / (camera.width * camera.height)
                observable = ladder.is_observable(fault.magnitude, share)
                yield _copy_of(
                    base, "local", f"{_label(part)}-region{trial}", (part,), observable, "in a random region"
                )

    def composite(self, first: Pair, second: Pair) -> PlannedFile:
        """Two severe faults at once."""
        base = self._base(first)
        faults = self._severe(first, base), self._severe(second, base)
        return _copy_of(base, "composite", "+".join(map(_label, faults)), faults, True, "two faults at once")

    def _random_fault(self, pair: Pair, base: PlannedFile, random: np.random.Generator) -> PlannedFault:
        """Return a fault of random size, and of random direction where it has one."""
        ladder = self._ladder(pair, base)
        if not allows_direction(*pair):
            return self._fault(pair, base, random_magnitude_of(ladder, random))
        magnitude = random_magnitude_of(replace(ladder, whole=False), random)
        return replace(self._fault(pair, base, magnitude), direction_deg=round(random.uniform(0.0, 360.0), 3))

    def _ladder(self, pair: Pair, base: PlannedFile) -> Ladder:
        return ladder_of(*pair, noisy_pose=_has_pose_noise(self.scenes[base.scene]))

    def _severe(self, pair: Pair, base: PlannedFile) -> PlannedFault:
        """Return the severest rung, and one above the nominal at least."""
        return self._fault(pair, base, self._ladder(pair, base).rungs(max(self.options.ladder, 3))[-1])

    def _fault(self, pair: Pair, base: PlannedFile, magnitude: float | None) -> PlannedFault:
        cause, stream = pair
        donor = None
        if cause == "other_sequence":  # a clean file of another flight, if there is any
            flight = self.scenes[base.scene].flight
            candidates = [clean.file for clean in self.clean if self.scenes[clean.scene].flight != flight]
            donor = candidates[_number(f"{pair}") % len(candidates)] if candidates else None
        return PlannedFault(
            cause=cause,
            stream=stream,
            magnitude=magnitude,
            unit=self._ladder(pair, base).unit or default_unit(cause, stream),
            seed=_number(f"{pair}{magnitude}"),
            donor=donor,
        )

    def _bases(self, pair: Pair) -> tuple[PlannedFile, ...]:
        """Return the clean sequences that trials are planted in, those of one seed and different scenes in a row.

        Faults whose nominal size noise of the pose changes by orders of magnitude are planted without that noise, where
        there is such a scene: one curve of detection could not describe both.
        """
        can_hold = self._can_hold(pair)
        quiet = [file for file in can_hold if not _has_pose_noise(self.scenes[file.scene])]
        return tuple(sorted(quiet if depends_on_pose_noise(*pair) and quiet else can_hold, key=lambda file: file.seed))

    def _can_hold(self, pair: Pair) -> list[PlannedFile]:
        """Return the clean sequences with the noise that the fault is about, or all where none has it."""
        return [file for file in self.clean if _has_noise_of(self.scenes[file.scene], *pair)] or [*self.clean]

    def _base(self, pair: Pair) -> PlannedFile:
        candidates = self._can_hold(pair)
        return candidates[_number(f"{pair}") % len(candidates)]


def _copy_of(
    base: PlannedFile, folder: str, name: str, faults: tuple[PlannedFault, ...], observable: bool, notes: str = ""
) -> PlannedFile:
    return PlannedFile(
        file=f"{folder}/{name}-{base.scene}-{base.seed}.h5",
        scene=base.scene,
        seed=base.seed,
        start_s=base.start_s,
        base=base.file,
        faults=faults,
        observable=observable,
        notes=notes,
    )


def _label(fault: PlannedFault) -> str:
    size = "" if fault.magnitude is None else f"-{fault.magnitude:g}"
    return f"{fault.stream}-{fault.cause}{size}"


def _number(text: str) -> int:
    """Return a number that depends on a text alone and is the same on every machine."""
    return zlib.crc32(text.encode())


def _has_pose_noise(scene: Scene) -> bool:
    return scene.pose.position_sigma_m > 0 or scene.pose.rotation_sigma_rad > 0


def _has_noise_of(scene: Scene, cause: str, stream: str) -> bool:
    """Whether the scene has the noise that a fault is about; other faults need none."""
    if cause not in ("noise_misdeclared", "flow_from_noisy_pose"):
        return True
    if stream == "events":
        return any((scene.events.threshold_sigma, scene.events.leak_rate_hz, scene.events.shot_rate_hz))
    if stream == "imu":
        return any((scene.imu.gyro_noise_density, scene.imu.accel_noise_density))
    return _has_pose_noise(scene)
