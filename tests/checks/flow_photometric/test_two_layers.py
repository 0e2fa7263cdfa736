"""Frames with flow and without depth: what one surface hides of another is not compared, and errors of flow show."""

from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.flow.mask import flow_conflicts
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.types import Result
from tests.support.two_layers import Floats, TwoLayers

DIALECT = """
name = "pair"
[files]
images = "images/*.png"
image_times = "image_times.txt"
flow = "flow.npy"
flow_times = "flow_times.txt"
[datasets]
"path/rgb" = { file = "images" }
"path/rgb_ts" = { file = "image_times", time_unit = "us" }
"path/flow/10hz" = { file = "flow" }
"path/flow/10hz_ts" = { file = "flow_times", time_unit = "us" }
[metadata]
"metadata/flow/unit" = "px"
"metadata/flow/model" = "scene"
"metadata/cameras/rgb/width" = 320
"metadata/cameras/rgb/height" = 240
"metadata/cameras/rgb/K" = [[320.0, 0.0, 159.5], [0.0, 320.0, 119.5], [0.0, 0.0, 1.0]]
"metadata/cameras/rgb/T_body_camera" = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
"metadata/cameras/events/width" = 320
"metadata/cameras/events/height" = 240
"metadata/cameras/events/K" = [[320.0, 0.0, 159.5], [0.0, 320.0, 119.5], [0.0, 0.0, 1.0]]
"metadata/cameras/events/T_body_camera" = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
"""


@pytest.mark.parametrize(
    ("relative_px", "scale"), list(product([(0.3, 0.0), (1.5, -0.5), (25.0, -7.0), (95.0, 0.0)], [0.7, 1.0, 1.4]))
)
def test_nothing_hidden_counts_as_visible(relative_px: tuple[float, float], scale: float) -> None:
    """Two sources of one target are an occlusion: no pixel that the disc hides is left, at any speed and growth."""
    scene = TwoLayers((-3.3, 2.1), (relative_px[0] - 3.3, relative_px[1] + 2.1), scale)
    flow_px = scene.flow_px.astype(np.float32)
    breaks, crowded = flow_conflicts(flow_px)
    columns, rows = np.meshgrid(np.arange(scene.width), np.arange(scene.height))
    to_columns, to_rows = (
        np.rint(place + flow_px[..., axis]).astype(int) for axis, place in enumerate((columns, rows))
    )
    visible = (to_columns >= 0) & (to_columns < scene.width) & (to_rows >= 0) & (to_rows < scene.height)
    visible[visible] = crowded[to_rows[visible], to_columns[visible]] == 0
    visible &= breaks == 0
    assert not np.any(visible & scene.is_hidden)
    # Of the wall that stays visible, most is compared.
    wall = ~scene.is_disc & ~scene.is_hidden
    assert np.count_nonzero(visible & wall) > 0.8 * np.count_nonzero(wall)


def residual(scene: TwoLayers, flow_px: Floats, folder: Path) -> Result:
    (folder / "pair/images").mkdir(parents=True)
    for number, frame in enumerate(scene.frames()):
        cv2.imwrite(str(folder / f"pair/images/{number:06}.png"), frame)
    np.save(folder / "pair/flow.npy", flow_px[np.newaxis].astype(np.float32))
    (folder / "pair/image_times.txt").write_text("0\n100000\n")
    (folder / "pair/flow_times.txt").write_text("0 100000\n")
    (folder / "pair.toml").write_text(DIALECT)
    options = CheckOptions(
        select=("flow_photometric.residual",), dialect=load_choice(str(folder / "pair.toml"), None), evidence=None
    )
    (result,) = check_file(folder / "pair", options).record.results
    return result


SCENE = TwoLayers((-3.3, 2.1), (14.6, -5.2), 1.1, radius_px=70.0)


def test_right_flow_passes_at_an_occlusion(tmp_path: Path) -> None:
    """The disc hides a strip of the wall of 20 px, and no tile of it counts."""
    assert np.count_nonzero(SCENE.is_hidden) > 2000
    assert residual(SCENE, SCENE.flow_px, tmp_path).outcome == "passed"


@pytest.mark.parametrize("layer", ["disc", "wall"])
def test_wrong_flow_of_one_layer_is_found(layer: str, tmp_path: Path) -> None:
    """Half a pixel and three quarters: the displacement of the chairs of FlyingChairs against their flow."""
    is_wrong = SCENE.is_disc if layer == "disc" else ~SCENE.is_disc
    result = residual(SCENE, SCENE.flow_px - np.where(is_wrong[..., None], (0.5, 0.75), 0.0), tmp_path)
    assert result.outcome == "failed"
    if layer == "disc":
        # The mean follows the wall, which has more tiles.
        (worst,) = (measured.value for measured in result.measurements if measured.name.endswith("worst_tile"))
        assert worst == pytest.approx(np.hypot(0.5, 0.75), rel=0.1)
