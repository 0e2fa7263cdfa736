"""A trajectory as TUM has it: a line of text a pose, seconds, position in m and orientation x, y, z, w.

Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

from pathlib import Path

from fedora_qa.conventions import US_PER_S
from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import replacing
from fedora_qa.sequence.sequence import Sequence, file_times_us, row_blocks


def write_tum(sequence: Sequence, target: Path) -> dict[str, int]:
    """Write the poses of the body in the world, and return the number of rows by stream.

    Raises
    ------
    MisuseError
        The sequence has no poses.
    UnreadableRowsError
        Rows cannot be decoded.
    """
    layout = sequence.layout
    if "pose" not in layout.streams:
        raise MisuseError(f"Expected poses to write a trajectory of, got none: {layout.absent['pose']}")
    count = layout.bindings["path/pose/ts"].rows
    with replacing(target) as partial, partial.open("w", encoding="utf-8") as text:
        text.write("# timestamp tx ty tz qx qy qz qw\n")
        for start, stop in row_blocks(count):
            times_us = file_times_us(sequence, "path/pose/ts", start, stop)
            positions = sequence.rows("path/pose/position", start, stop)
            orientations = sequence.rows("path/pose/orientation", start, stop)
            for time_us, position, orientation in zip(times_us.tolist(), positions, orientations, strict=True):
                sign, whole = "-" if time_us < 0 else "", abs(time_us)
                numbers = " ".join(repr(float(value)) for value in (*position, *orientation))
                text.write(f"{sign}{whole // US_PER_S}.{whole % US_PER_S:06d} {numbers}\n")
    return {"pose": count}
