"""The record of half an hour with a thousand findings, and as much evidence as is ever kept of a file.

All of it is invented, and worse than real: pictures are noise, which nothing compresses.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.record.types import (
    Coverage,
    Diagnosis,
    FileRecord,
    Finding,
    Measurement,
    Record,
    Result,
    Run,
    Tool,
    Where,
)

SECONDS: Final = 1800
FINDINGS: Final = 1000
PICTURE: Final = (216, 288)
SENSOR: Final = (240, 320)
MOMENTS: Final = EvidenceOptions().snapshots
PLACES: Final = EvidenceOptions().worst_locations
BESIDE: Final = EvidenceOptions().beside
TRIALS: Final = EvidenceOptions().trials

_STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", "flow/10hz", "flow/25hz", "flow/50hz")
_CHECKS: Final = tuple(f"{subject}.{name}" for subject in (
    "integrity", "metadata", "clocks", "event_stream", "event_response", "flow_photometric", "flow_geometry", "depth",
    "pose", "imu",
) for name in ("order", "range", "residual", "timing", "model"))  # fmt: skip

Arrays = dict[str, NDArray[Any]]


def long_record(arrays: Arrays) -> Record:
    """One file: fifty checks of six measurements each, twenty of which failed, with a thousand findings in all."""
    results = tuple(_result(k, check) for k, check in enumerate(_CHECKS))
    file = FileRecord(
        path="/data/release/half-an-hour.h5",
        size=180_000_000_000,
        sha256="ab" * 32,
        digest_kind="partial",
        dialect="fedora",
        inferred={},
        statistics={"sequence": {"duration_s": float(SECONDS)}, "rgb": {"brightness_mean_dn": 90.0}},
        verdict="findings",
        results=results,
        diagnoses=tuple(_diagnosis(k) for k in range(8)),
        evidence={name: f"{name}, in units of its own" for name in arrays},
    )
    run = Run("2026-01-01T00:00:00+00:00", {f"check {check}": 1.0 for check in _CHECKS}, {"cores": 16})
    return Record("1.0", "1", Tool("fedora-qa", "0.1.0"), "cd" * 32, run, (file,), "full")


def long_arrays() -> Arrays:
    """All moments, all places, the gravest with the frames beside them, and all series at their full length."""
    rng = np.random.default_rng(1800)
    end_us = SECONDS * 1e6
    arrays = {f"moments/{name}": stack for name, stack in _pictures(rng, MOMENTS).items()}
    arrays["moments/times_us"] = np.linspace(0.0, end_us, MOMENTS)
    for k in range(PLACES):
        for j, group in enumerate(("", "/before", "/after") if k < BESIDE else ("",)):
            own = {f"places/F{k + 1}{group}/{name}": stack[0] for name, stack in _pictures(rng, 1).items()}
            arrays |= own | {
                f"places/F{k + 1}{group}/times_us": np.float64(end_us / (PLACES + 1) * k + 20e3 * (0, -1, 1)[j])
            }
        arrays[f"places/F{k + 1}/box"] = np.array([0.2, 0.3, 0.4, 0.6])
    for k in range(TRIALS):
        for when in ("before", "after"):
            group = f"trials/D{k + 1}/{when}"
            # A fault of the frames alters most pictures: those of depth and flow stay.
            pictures = _pictures(rng, 1).items()
            altered = {name: stack[0] for name, stack in pictures if not name.startswith(("depth", "flow"))}
            arrays |= {f"{group}/{name}": array for name, array in altered.items()}
            for check in _CHECKS[:2]:
                arrays[f"{group}/{check}/map"] = rng.normal(0.0, 1.0, SENSOR).astype(np.float32)
                arrays[f"{group}/{check}/series"] = np.stack([np.arange(500.0), rng.normal(0.0, 1.0, 500)], axis=1)
    arrays["timeline/edges_us"] = np.linspace(0.0, end_us, 201)
    arrays |= {f"timeline/{stream}": rng.integers(90, 110, 200) for stream in _STREAMS}
    for quantity in ("depth_m", "luma_dn", "flow_10hz", "flow_25hz", "flow_50hz", "event_rate_hz"):
        arrays[f"histograms/{quantity}/edges"] = np.arange(129.0)
        arrays[f"histograms/{quantity}/counts"] = rng.integers(1, 10**6, 128)
    arrays["distributions/pixel_interval_ms/edges"] = np.concatenate([[0.0], np.geomspace(1e-3, 100.0, 200)])
    arrays["distributions/pixel_interval_ms/counts"] = rng.integers(0, 10**6, (128, 200))
    turns = np.linspace(0.0, 40 * np.pi, 4000)
    arrays["trajectory/times_us"] = np.linspace(0.0, end_us, 4000)
    arrays["trajectory/positions_world_m"] = np.stack([90 * np.cos(turns), 50 * np.sin(turns * 1.1), turns / 9], axis=1)
    arrays["trajectory/speeds_m_s"] = 5 + 3 * np.sin(turns * 7)
    arrays["trajectory/forward_world"] = np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1)
    for check in _CHECKS[:20]:
        arrays[f"{check}/map"] = rng.normal(0.0, 1.0, SENSOR).astype(np.float32)
        arrays[f"{check}/series"] = np.stack([np.arange(2000.0), rng.normal(0.0, 1.0, 2000)], axis=1)
    return {name: np.asarray(array) for name, array in arrays.items()}


def _pictures(rng: np.random.Generator, count: int) -> Arrays:
    times_us = np.linspace(0.0, SECONDS * 1e6, count)
    return {
        "rgb": rng.integers(0, 256, (count, *PICTURE, 3)).astype(np.uint8),
        "rgb_times_us": times_us,
        "depth_m": rng.uniform(1.0, 60.0, (count, *PICTURE)).astype(np.float32),
        "flow_px": rng.normal(0.0, 8.0, (count, *PICTURE, 2)).astype(np.float32),
        "flow_interval_us": np.stack([times_us, times_us + 20e3], axis=1),
        "residual_dn": rng.normal(0.0, 30.0, (count, *PICTURE)).astype(np.float16),
        "brighter": rng.integers(0, 5, (count, *SENSOR)).astype(np.uint16),
        "darker": rng.integers(0, 5, (count, *SENSOR)).astype(np.uint16),
        "events_interval_us": np.stack([times_us - 10e3, times_us + 10e3], axis=1),
    }


def _result(k: int, check: str) -> Result:
    failed = k < 20
    count = FINDINGS // 20 if failed else 0
    findings = tuple(_finding(k * count + j, check) for j in range(count))
    measurements = tuple(
        Measurement(f"{_STREAMS[j]} worst_tile", 4.2 if failed else 0.3, "px", 0.1, 0.0, 1.5, 2.1) for j in range(6)
    )
    outcome = "failed" if failed else "passed"
    return Result(check, outcome, "Do the two agree?", measurements, Coverage(90_000, 90_000, "frames"), findings)


def _finding(number: int, check: str) -> Finding:
    stream = _STREAMS[number % len(_STREAMS)]
    start_us = (number * 7919 % FINDINGS) / FINDINGS * SECONDS * 1e6
    message = f"Field {number} of {stream} carries frame {number * 5} 1.42 px past the frame at its end, in one tile."
    where = Where(stream, start_us, start_us + 20e3, number, number + 1, number * 5, None, (276, 215, 308, 247))
    return Finding(f"F{number + 1}", f"{check}.tile", "error" if number % 3 else "critical", message, where)


def _diagnosis(k: int) -> Diagnosis:
    explains = tuple(f"F{number + 1}" for number in range(k, FINDINGS, 8))
    return Diagnosis(
        f"D{k + 1}", "time_offset", _STREAMS[k], 3.0, "ms", 0.1, 0.9, Where(_STREAMS[k]), "Find the latency.", explains
    )
