"""What nobody asks for is not decoded."""

from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import pytest

from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.evidence.options import EvidenceOptions
from tests.support.all_checks import CHECKS
from tests.support.handmade import write_handmade

IMAGES = {"path/rgb", "path/depth", "path/flow/10hz", "path/flow/25hz", "path/flow/50hz"}
MOTION = {"path/imu/angular_velocity", "path/imu/linear_acceleration", "path/pose/position", "path/pose/orientation"}
PATH = {"path/pose/position", "path/pose/orientation"}
"""Every report draws it: kilobytes."""
EVENTS = {"path/events/x", "path/events/y", "path/events/t", "path/events/p"}


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Counts the blocks that are decoded, by dataset."""
    counts: Counter[str] = Counter()
    decode = BlockDecoder._decode

    def counting(self: BlockDecoder, key: str, number: int, rows: int) -> Any:
        counts[key] += 1
        return decode(self, key, number, rows)

    monkeypatch.setattr(BlockDecoder, "_decode", counting)
    return counts


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_handmade(tmp_path_factory.mktemp("asked") / "whole.h5")


def check(path: Path, *select: str) -> None:
    check_file(path, CheckOptions(select=select, evidence=EvidenceOptions(snapshots=2)))


SELECTED = {
    "clocks.order": set(),
    "clocks.rate": set(),
    "metadata": set(),
    "imu": MOTION,
    "pose": MOTION,
    "event_stream": EVENTS,
    "event_response": EVENTS | {"path/rgb"},
    "depth.range": {"path/depth"},
    "depth.consistency": {"path/depth"} | MOTION,
    "flow_rates": IMAGES - {"path/rgb", "path/depth"},
    "images.repeats": IMAGES | MOTION,
}
"""What each selection may decode at most."""


@pytest.mark.parametrize(("select", "allowed"), SELECTED.items(), ids=SELECTED)
def test_a_selection_decodes_what_it_needs(select: str, allowed: set[str], whole: Path, decoded: Counter[str]) -> None:
    """Neither other checks nor statistics nor pictures make a selection decode what its own checks do not look at."""
    check(whole, select)
    assert decoded.keys() <= allowed | PATH


def test_each_block_is_decoded_once(whole: Path, decoded: Counter[str]) -> None:
    """A whole run, its statistics among it, decodes every frame of the file once."""
    check(whole)
    with h5py.File(whole) as file:
        assert {key: decoded[key] for key in IMAGES} == {key: len(file[key]) for key in IMAGES}


def test_missing_streams_cost_nothing(tmp_path: Path, decoded: Counter[str]) -> None:
    """Without colour frames and depth, nothing of events but their own checks is decoded, and no image."""
    path = write_handmade(tmp_path / "part.h5")
    with h5py.File(path, "r+") as file:
        for name in ("path/rgb", "path/rgb_ts", "path/depth", "path/depth_ts", "path/flow", "metadata/flow"):
            del file[name]
    # Jitter is measured of events alone.
    of_events = [x.name for x in CHECKS if x.name.startswith("event_response.") and x.name != "event_response.jitter"]
    check(path, *of_events, "alignment", "flow_photometric", "flow_geometry", "depth", "images")
    assert decoded.keys() <= PATH
