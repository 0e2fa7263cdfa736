"""A report of an imaginary file with many findings, some of them with hostile names, to be used in a browser."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.record.types import Finding, Measurement, Record, Where
from fedora_reports import trajectory
from fedora_reports.detection_power import DetectableCause, PassDetectionPower
from fedora_reports.html import render_html
from tests.reports.evidence_samples import all_kinds, frusta, point_cloud
from tests.support.records import crashed, failed, file_record, late_events, not_observable, passed, record

FINDINGS: Final = 40
HOSTILE: Final = "<img src=x onerror='console.error(1)'><script>console.error(2)</script>"
HOSTILE_NAME: Final = HOSTILE.replace("/", "")  # of a file: without folders
STREAMS: Final = ("rgb", "events", "depth", HOSTILE)

WORTH: Final = PassDetectionPower(
    (DetectableCause("events:time_offset", "event_response.timing", "95% at 3.2 (2.1 to 5) ms", best=True),),
    "Over 10 short and small files.",
)


def sample_record(findings: int = FINDINGS) -> Record:
    """Checks of every outcome; many findings over two seconds, F1 and F2 of them those of ``failed``."""
    many = tuple(
        Finding(
            id=f"F{k}",
            code="event_response.timing.offset",
            severity="critical" if k == findings - 10 else "error",
            message=f"Finding number {k} {HOSTILE if k == 9 else 'is late'}.",
            where=Where(STREAMS[k % 4], 2e6 * ((7 * k) % FINDINGS) / FINDINGS),
        )
        for k in range(3, findings + 1)
    )
    timing = replace(failed(), findings=(*failed().findings, *many))
    near = Measurement("rate_change", 0.9, "ppm", 0.1, 0.0, 1.0, 1.6)
    checks = (passed(), replace(passed("clocks.rate"), measurements=(near,)), timing, crashed(), not_observable())
    return record(file_record(*checks, path=f"/data/{HOSTILE_NAME}.h5", diagnoses=(late_events(),)))


def sample_arrays() -> dict[str, NDArray[Any]]:
    """Three moments, the place of F1 with the frames beside it, and a path."""
    turns = np.linspace(0.0, 6.0, 50)
    return all_kinds() | {
        "trajectory/times_us": np.linspace(0.0, 2e6, 50),
        "trajectory/positions_world_m": np.stack([9 * np.cos(turns), 5 * np.sin(turns), turns], axis=1),
        "trajectory/speeds_m_s": 2 + np.sin(turns),
        "trajectory/forward_world": np.stack([-np.sin(turns), np.cos(turns), 0 * turns], axis=1),
    }


def sample_world() -> dict[str, NDArray[Any]]:
    """Points of a wall beside the path, and two views of a camera at its start."""
    return point_cloud() | frusta(np.array([9.0, 0.0, 0.0])) | {"point_cloud/origin_world_m": np.zeros(3)}


def write_sample(target: Path, *, with_world: bool = True, findings: int = FINDINGS) -> Path:
    """Write the report, without a picture in space, which would need OpenGL; perhaps with points of the world."""
    arrays = sample_arrays() | (sample_world() if with_world else {})
    with pytest.MonkeyPatch.context() as patch:
        nothing = trajectory.TrajectoryPicture(b"", "", "")
        patch.setattr(trajectory, "render_trajectory", lambda *_: nothing)
        target.write_text(render_html(sample_record(findings), arrays, WORTH), encoding="utf-8")
    return target
