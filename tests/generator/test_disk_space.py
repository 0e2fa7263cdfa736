"""Disk space: the least that a sequence takes is less than any takes, and what is likely is only warned of."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator import resources
from fedora_generator.errors import OutputError
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.layout.create import create_dataset

IMAGES = frozenset({"rgb", "depth", "flow"})


@pytest.mark.parametrize("size", [(72, 54), (1440, 1080)])
def test_the_least_is_less_than_blank_images_take(tmp_path: Path, size: tuple[int, int]) -> None:
    """Frames of one colour without any depth, which compress best; a fiftieth of a second of each stream."""
    width, height = size
    sizes = {"H": height, "W": width, "H_rgb": height, "W_rgb": width, "N": 1, "D": 1, "K10": 1, "K25": 1, "K50": 1}
    rates_hz = {"path/rgb": 50, "path/depth": 50, "path/flow/10hz": 10, "path/flow/25hz": 25, "path/flow/50hz": 50}
    with h5py.File(tmp_path / "blank.h5", "w") as file:
        a_second = 0.0
        for key, rate_hz in rates_hz.items():
            dataset = create_dataset(file, key, sizes)
            dataset[0] = 7 if key == "path/rgb" else np.nan
            a_second += rate_hz * dataset.id.get_storage_size()
    scene = load_scene("park-day").with_size(width, height)
    assert 0 < resources.least_bytes(scene, 1_000_000, IMAGES) < a_second


def test_streams_left_out_need_no_room() -> None:
    """Each is a share of the whole; what is not made of images needs next to nothing."""
    scene = load_scene("park-day")
    shares = [resources.expected_bytes(scene, 1.0, frozenset({name})) for name in ("rgb", "depth", "events", "flow")]
    assert sum(shares) == pytest.approx(resources.expected_bytes(scene, 1.0), abs=4)
    assert min(shares) > 0
    assert resources.expected_bytes(scene, 1.0, frozenset({"imu", "pose"})) == 0


def test_a_full_disk_is_refused_and_a_small_one_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing free: refused at once, whatever the streams; too little for what is likely: one line, and the work."""
    scene, warnings = load_scene("hover").with_size(72, 54), list[str]()
    usage = shutil.disk_usage(tmp_path)

    def generate(free_bytes: int, *streams: str) -> None:
        monkeypatch.setattr(resources.shutil, "disk_usage", lambda _: usage._replace(free=free_bytes))
        request = Request(duration_s=0.02, streams=frozenset(streams))
        generate_sequence(scene, tmp_path / "a.h5", request, overwrite=True, warn=warnings.append)

    with pytest.raises(OutputError, match=r"free for the sequence, got 0.00 MB at .*; make room"):
        generate(0, "imu")
    assert list(tmp_path.iterdir()) == []
    generate(8_000, "depth")
    assert len(warnings) == 1
    assert "are expected, and 0.01 MB are free" in warnings[0]
    generate(10**12, "depth")
    assert len(warnings) == 1
