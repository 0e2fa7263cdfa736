"""Objects that move by themselves: left out where they are marked, and missed where they are not."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.generate import Request, generate_sequence
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Result
from tests.support.sequences import small_scene

Edit = Callable[[h5py.File], None]

GEOMETRY = ("flow_geometry", "depth.consistency", "depth.scale", "depth.projection")
ENDPOINT, CONSISTENCY = "flow_geometry.endpoint", "depth.consistency"
RATES_HZ = (10, 25, 50)


@pytest.fixture(scope="module")
def traffic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """0.4 s of the park with a cart and a drone: depth, pose and flow."""
    path = tmp_path_factory.mktemp("traffic") / "traffic.h5"
    request = Request(duration_s=0.4, streams=frozenset({"depth", "pose", "flow"}))
    generate_sequence(small_scene("park-traffic", 126, 96), path, request)
    return path


def checked(
    path: Path, tmp_path: Path, edit: Edit | None = None, select: tuple[str, ...] = GEOMETRY
) -> dict[str, Result]:
    changed = tmp_path / "changed.h5"
    shutil.copy(path, changed)
    if edit is not None:
        with h5py.File(changed, "r+") as file:
            edit(file)
    record = check_file(changed, CheckOptions(select=select)).record
    return {result.check: result for result in record.results}


def each_rate(file: h5py.File, name: str) -> list[h5py.Dataset]:
    return [file[name.format(rate_hz)] for rate_hz in RATES_HZ]


def without_masks(file: h5py.File) -> None:
    for rate_hz in RATES_HZ:
        del file[f"path/flow/{rate_hz}hz_moving"]


def one_mask_only(file: h5py.File) -> None:
    for rate_hz in (10, 25):
        del file[f"path/flow/{rate_hz}hz_moving"]


def empty_masks(file: h5py.File) -> None:
    for mask in each_rate(file, "path/flow/{}hz_moving"):
        mask[...] = np.zeros_like(mask[...])


def flow_too_large(file: h5py.File) -> None:
    for flow in each_rate(file, "path/flow/{}hz"):
        flow[...] = 1.01 * flow[...]


def depth_too_large(file: h5py.File) -> None:
    file["path/depth"][...] = 1.02 * file["path/depth"][...]


def test_what_stands_is_checked_to_rounding(traffic: Path, tmp_path: Path) -> None:
    """Flow, depth and pose of a world with movers agree as closely as those of a world without."""
    results = checked(traffic, tmp_path)
    assert {result.outcome for result in results.values()} == {"passed"}
    worst = {m.name: m.value for m in results["flow_geometry.endpoint"].measurements}
    assert worst["flow/50hz worst_endpoint_error"] < 1e-3


def test_without_masks_nothing_is_said_of_a_moving_world(traffic: Path, tmp_path: Path) -> None:
    """The camera's motion explains nothing then, and the reason says why."""
    results = checked(traffic, tmp_path, without_masks)
    for name in (ENDPOINT, CONSISTENCY, "depth.scale", "depth.projection"):
        assert results[name].outcome == "not_applicable"
        assert "no mask marks their pixels" in results[name].reason
    assert results["flow_geometry.validity"].outcome == "passed"


def test_the_mask_of_one_rate_serves_all(traffic: Path, tmp_path: Path) -> None:
    """What moves in a frame moves in every field that starts with it."""
    results = checked(traffic, tmp_path, one_mask_only, (ENDPOINT, CONSISTENCY))
    assert {result.outcome for result in results.values()} == {"passed"}


def test_what_moves_without_a_mark_is_found(traffic: Path, tmp_path: Path) -> None:
    """A cart that is said to stand makes flow and depth disagree with the pose."""
    results = checked(traffic, tmp_path, empty_masks, (ENDPOINT, CONSISTENCY))
    assert {result.outcome for result in results.values()} == {"failed"}


@pytest.mark.parametrize(("edit", "failing"), [(flow_too_large, ENDPOINT), (depth_too_large, "depth.scale")])
def test_faults_of_what_stands_are_found(edit: Edit, failing: str, traffic: Path, tmp_path: Path) -> None:
    """Leaving out what moves hides no fault of the rest."""
    assert checked(traffic, tmp_path, edit, (failing,))[failing].outcome == "failed"
