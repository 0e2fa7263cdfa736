"""What checks of events cost beyond decoding: a frame, and an event, as the slope between two thresholds.

python -m tests.benchmarks.event_checks [FILE...]     prints a table; with files, also what each check takes of them
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.engine import decode
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.survey import Survey, opened, survey_of
from tests.support.all_checks import CHECKS

SUBJECTS: Final = ("event_stream", "event_response")
SHAPE: Final = (480, 640)
DURATION_NS: Final = 600_000_000
STEP_NS: Final = 2_000_000
FRAME_NS: Final = 20_000_000
THRESHOLDS: Final = (0.4, 0.05)
TIMES: Final = 4


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor seconds of the checks of a file, decoding apart, and what they are spent on."""

    frames: int
    events: int
    decoding_s: float
    by_check_s: dict[str, float]

    @property
    def seconds(self) -> float:
        """Of all checks."""
        return sum(self.by_check_s.values())


def grating(time_s: float) -> NDArray[np.float64]:
    """Log intensity (h, w) of a grating that drifts at 0.4 Hz, and is steepest in the middle."""
    x, y = np.arange(SHAPE[1]), np.arange(SHAPE[0])[:, np.newaxis]
    phase = 2 * np.pi * ((0.8 * x + 0.6 * y) / 60 - 0.4 * time_s)
    log_light: NDArray[np.float64] = np.log(100) + (0.5 + 0.4 * np.cos(x / 90) * np.cos(y / 70)) * np.sin(phase)
    return log_light


def write_sequence(path: Path, threshold: float) -> Path:
    """Write frames of the grating, and its events: crossings of straight lines within 2 ms, from an even start."""
    from tests.estimators.event_world import camera_matrix  # noqa: PLC0415 - of no use where files are given

    reference = grating(0.0) + threshold * np.random.default_rng(1).uniform(-0.99, 0.99, SHAPE)
    signal, found = grating(0.0).ravel(), []
    reference = reference.ravel()
    for start_ns in range(0, DURATION_NS, STEP_NS):
        following = grating((start_ns + STEP_NS) / NS_PER_S).ravel()
        while len(hit := np.flatnonzero(np.abs(following - reference) >= threshold)):
            up = following[hit] > reference[hit]
            reference[hit] += np.where(up, threshold, -threshold)
            share = (reference[hit] - signal[hit]) / (following[hit] - signal[hit])
            found.append(np.stack([start_ns // 1000 + np.ceil(share * STEP_NS / 1000), hit, up]))
        signal = following
    times_us, pixels, p = np.concatenate(found, axis=1).astype(np.int64)
    order = np.argsort(times_us, kind="stable")
    rows, columns = np.divmod(pixels[order], SHAPE[1])
    timestamps = np.arange(0, DURATION_NS + 1, FRAME_NS)
    frames = np.array(
        [np.rint(np.exp(grating(timestamp / NS_PER_S))).clip(0, 255) for timestamp in timestamps], np.uint8
    )
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "fedora", "format_version": "1.0"})
        file["path/rgb"], file["path/rgb_ts"] = frames[..., np.newaxis].repeat(3, axis=3), timestamps // 1000
        file["path/events/x"], file["path/events/y"] = columns.astype(np.uint16), rows.astype(np.uint16)
        file["path/events/t"], file["path/events/p"] = times_us[order], p[order].astype(np.uint8)
        ideal = {"model": "log", "threshold_on": threshold, "threshold_off": threshold, "polarity": "1=brighter"}
        file.create_group("metadata/events").attrs.update(ideal)
        for name in ("events", "rgb"):
            file.create_group(f"metadata/cameras/{name}").attrs.update({
                "width": SHAPE[1], "height": SHAPE[0], "K": camera_matrix(SHAPE[1], SHAPE[0]),
                "T_body_camera": np.eye(4), "camera_model": "pinhole",
            })  # fmt: skip
    return path


@contextmanager
def decoding_counted() -> Iterator[list[float]]:
    """Count the processor seconds of decoding in the first place of what is yielded."""
    spent, decode_block = [0.0], decode.BlockDecoder._decode

    def counted(self: decode.BlockDecoder, key: str, number: int, rows: int) -> Any:
        began = time.process_time()
        block = decode_block(self, key, number, rows)
        spent[0] += time.process_time() - began
        return block

    decode.BlockDecoder._decode = counted  # type: ignore[method-assign]
    try:
        yield spent
    finally:
        decode.BlockDecoder._decode = decode_block  # type: ignore[method-assign]


def cost_of(path: Path) -> Cost:
    """Measure a file some times, and return the fastest: what is compiled and loaded once is no cost of an event."""
    checks = tuple(check for check in CHECKS if check.name.split(".")[0] in SUBJECTS)
    survey = survey_of(path, checks, CheckOptions(select=SUBJECTS), lambda *_: None)
    if isinstance(survey, FileRun):
        raise TypeError(f"Expected a file that HDF5 opens, got {path}")
    with decoding_counted() as spent:
        facts = survey.scanned.facts
        events = facts.events.count if facts.events is not None else 0
        costs = []
        for _ in range(TIMES):
            spent[0] = 0.0
            seconds = _seconds(survey, spent)
            costs.append(Cost(len(facts.clocks["rgb"].times_ns), events, spent[0], seconds))
        return min(costs, key=lambda cost: cost.seconds)


def _seconds(survey: Survey, spent: list[float]) -> dict[str, float]:
    seconds = {check.name: 0.0 for check in survey.asked}
    with opened(survey) as file:
        states = {check.name: check.start(file.ready.facts) for check in survey.asked}
        for span in file.windows:
            window = file.ready.decoder.window(span, file.ready.facts, survey.plan.sampling)
            for check in survey.asked:
                began, decoded = time.process_time(), spent[0]
                check.update(states[check.name], window)
                seconds[check.name] += time.process_time() - began - (spent[0] - decoded)
        for check in survey.asked:
            began = time.process_time()
            check.conclude(states[check.name], file.ready.facts)
            seconds[check.name] += time.process_time() - began
    return seconds


def print_cost(name: str, cost: Cost) -> None:
    """Print a file, and its checks."""
    print(f"\n{name}: {cost.frames} frames, {cost.events} events; decoding {cost.decoding_s:.2f} s")
    for check, seconds in cost.by_check_s.items():
        print(f"  {check:35s} {seconds:7.3f} s")
    print(f"  {'all':35s} {cost.seconds:7.3f} s, {cost.seconds / cost.frames * 1e3:.1f} ms a frame")


def main(files: list[str]) -> None:
    """Print what files cost; the slope where none is given."""
    if files:
        for name in files:
            print_cost(name, cost_of(Path(name)))
        return
    with tempfile.TemporaryDirectory() as folder:
        few, many = (cost_of(write_sequence(Path(folder) / "seq.h5", threshold)) for threshold in THRESHOLDS)
    for threshold, cost in zip(THRESHOLDS, (few, many), strict=True):
        print_cost(f"C = {threshold}", cost)
    slope_s = (many.seconds - few.seconds) / (many.events - few.events)
    print(f"\n{slope_s * 1e9:.1f} ns an event: {1e-6 / slope_s:.1f} M events/s a core")
    for check, seconds in many.by_check_s.items():
        part_s = (seconds - few.by_check_s[check]) / (many.events - few.events)
        print(f"  {check:35s} {part_s * 1e9:7.1f} ns")


if __name__ == "__main__":
    main(sys.argv[1:])
