"""Two faults in one file: are both named? Prints a table, and writes docs/named-composites.md."""

import argparse
import tempfile
from pathlib import Path
from typing import Final

from fedora_generator.faults.plant import plant_fault
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.causes import stream_family
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.markdown import table
from fedora_qa.record.types import Diagnosis

Planted = tuple[str, str, float | None]
"""Stream, cause, and size in the unit of the cause; None where it has none, or for the usual factor."""

_PAGE: Final = Path("docs/named-composites.md")

PAIRS: Final[tuple[tuple[Planted, Planted], ...]] = (
    (("events", "time_offset", 3), ("events", "polarity_inverted", None)),
    (("events", "time_offset", 3), ("events", "threshold_misdeclared", 20)),
    (("events", "spatial_offset", 1), ("events", "time_offset", 5)),
    (("events", "mirrored", None), ("events", "polarity_inverted", None)),
    (("events", "polarity_inverted", None), ("events", "threshold_misdeclared", 20)),
    (("flow", "flow_sign", None), ("flow", "flow_interval_shifted", 1)),
    (("flow", "flow_sign", None), ("flow", "flow_gain", 1.1)),
    (("flow", "flow_unit", None), ("flow", "flow_sign", None)),
    (("flow", "axes_swapped", None), ("flow", "flow_sign", None)),
    (("depth", "unit_mm_m", None), ("depth", "depth_ray_not_z", None)),
    (("depth", "unit_mm_m", None), ("depth", "spatial_offset", 1)),
    (("imu", "gyro_bias", 0.05), ("imu", "time_offset", 8)),
    (("imu", "gyro_bias", 0.05), ("imu", "accel_bias", 0.5)),
    (("imu", "unit_deg_rad", None), ("imu", "time_offset", 8)),
    (("imu", "gravity_sign", None), ("imu", "gyro_bias", 0.05)),
    (("pose", "quaternion_order", None), ("pose", "time_offset", 10)),
    (("pose", "quaternion_inverted", None), ("pose", "unit_mm_m", None)),
    (("rgb", "channel_order", None), ("rgb", "time_offset", 5)),
    (("rgb", "spatial_offset", 1), ("rgb", "time_offset", 5)),
    (("rgb", "exposure_or_gamma", 20), ("events", "time_offset", 4)),
    (("events", "time_offset", 3), ("flow", "flow_gain", 1.1)),
    (("depth", "unit_mm_m", None), ("imu", "gyro_bias", 0.05)),
    (("metadata", "intrinsics_focal", 3), ("events", "time_offset", 4)),
    (("rgb_to_event", "index_off_by_one", 1), ("events", "time_offset", 4)),
    (("flow", "flow_sign", None), ("pose", "quaternion_order", None)),
)
"""Pairs that befall one stream, and then those of two streams."""


def main() -> None:
    """Plant every pair in one clean sequence, check it, and state which of the faults are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, default=_PAGE)
    arguments = parser.parse_args()
    rows, named, both, further = [], 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        clean, with_first, faulty = (Path(folder) / f"{name}.h5" for name in ("clean", "first", "faulty"))
        generate_sequence(load_scene("park-day").with_size(270, 200), clean, Request(duration_s=1.0))
        for pair in PAIRS:
            for source, target, (stream, cause, size) in zip(
                (clean, with_first), (with_first, faulty), pair, strict=True
            ):
                target.unlink(missing_ok=True)
                plant_fault(source, target, cause, stream, size)
            diagnoses = check_file(faulty, CheckOptions(evidence=None, canary=False)).record.diagnoses
            hits = [any(_names(diagnosis, fault) for diagnosis in diagnoses) for fault in pair]
            wrong = [d for d in diagnoses if d.cause != "unknown" and not any(_names(d, fault) for fault in pair)]
            named, both, further = named + sum(hits), both + all(hits), further + bool(wrong)
            rows.append((*(_name(fault) for fault in pair), f"{sum(hits)} of 2", "; ".join(map(_summary, diagnoses))))
            print(" | ".join(rows[-1]), flush=True)
    share = f"{named} of {2 * len(PAIRS)} faults are named, both of {both} of {len(PAIRS)} pairs"
    share += f"; in {further} a further cause is named that was not planted"
    print(share)
    parts = [
        "# Two faults in one file",
        "The generator planted two faults, one after the other, in a sequence of park-day (270x200, 1 s). Each file "
        "was checked with the profile `release` (`make study-composites`).",
        f"**{share}.**",
        table(("first", "second", "named", "diagnoses"), rows),
    ]
    arguments.page.write_text("\n\n".join(parts) + "\n")


def _names(diagnosis: Diagnosis, fault: Planted) -> bool:
    stream, cause, _ = fault
    return diagnosis.cause == cause and stream_family(diagnosis.stream) == stream


def _name(fault: Planted) -> str:
    stream, cause, size = fault
    return f"{stream}:{cause}" + ("" if size is None else f" {size:g}")


def _summary(diagnosis: Diagnosis) -> str:
    size = "" if diagnosis.magnitude is None else f" {diagnosis.magnitude:.3g} {diagnosis.unit}"
    return f"{diagnosis.stream}:{diagnosis.cause}{size} ({diagnosis.status})"


if __name__ == "__main__":
    main()
