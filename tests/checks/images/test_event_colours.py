"""Channels and transfer of colour frames against events, in the closed-form event world with colours."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from tests.checks.event_file import DURATION_MS, FRAME_SHAPE, FRAMES_NS, SHAPE, EventFile, linear_file, log_file
from tests.estimators.event_world import MS, Waves, linear_events, log_events
from tests.support.checked import diagnosed, run_check

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ColouredWaves(Waves):
    """Three channels with waves of their own; luma is their weighted sum."""

    def channels(self, t_s: float, shape: tuple[int, int], scale: float = 1.0) -> Floats:
        own = [Waves(self.mean_dn, self.amplitude_dn, self.velocity_px_s, self.seed + i, self.count) for i in range(3)]
        return np.stack([waves.luma(t_s, shape, scale) for waves in own], axis=-1)

    def luma(self, t_s: float, shape: tuple[int, int], scale: float = 1.0) -> Floats:
        luma: Floats = self.channels(t_s, shape, scale) @ LUMA_WEIGHTS_RGB
        return luma


LOG = ColouredWaves(amplitude_dn=24.0, mean_dn=120.0, velocity_px_s=(200.0, 40.0), seed=3, count=5)
LINEAR = replace(LOG, amplitude_dn=21.0, velocity_px_s=(80.0, 30.0))


def coloured_frames(world: ColouredWaves) -> NDArray[np.uint8]:
    frames = [world.channels(time_ns * 1e-9, FRAME_SHAPE, 2.25) for time_ns in FRAMES_NS]
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


@cache
def coloured_log() -> EventFile:
    return EventFile(log_events(LOG, SHAPE, DURATION_MS * MS), coloured_frames(LOG))


@cache
def coloured_linear() -> EventFile:
    events = linear_events(LINEAR, SHAPE, DURATION_MS * MS, threshold=6.0)
    clean = EventFile(events, coloured_frames(LINEAR))
    return clean.declaring(model="linear", threshold_on=6.0, threshold_off=6.0)


FILES = {"log": coloured_log, "linear": coloured_linear}


@pytest.mark.parametrize("model", FILES)
@pytest.mark.parametrize("check", ["images.channels", "images.transfer"])
def test_clean_colours_pass(check: str, model: str, tmp_path: Path) -> None:
    """Both sensor models find R, G, B and a linear curve."""
    assert run_check(FILES[model]().write(tmp_path / "clean.h5"), check).outcome == "passed"


@pytest.mark.parametrize("model", FILES)
@pytest.mark.parametrize("order", [(2, 1, 0), (1, 0, 2), (0, 2, 1), (1, 2, 0), (2, 0, 1)], ids=str)
def test_every_wrong_order_is_found_and_named(model: str, order: tuple[int, ...], tmp_path: Path) -> None:
    """Any exchange of channels fails, and the statement names the order that was stored."""
    clean = FILES[model]()
    path = clean.altered(frames=clean.frames[..., order]).write(tmp_path / "faulty.h5")
    result, diagnoses = diagnosed(path, "images.channels")
    assert result.outcome == "failed"
    assert f"nearest order is {''.join('RGB'[i] for i in order)}" in result.findings[0].message
    assert (diagnoses[0].cause, diagnoses[0].stream) == ("channel_order", "rgb")


@pytest.mark.parametrize("model", FILES)
def test_display_codes_declared_as_linear_are_found(model: str, tmp_path: Path) -> None:
    """Codes of gamma 2.2 without a declaration fail with an exponent of a display, and such a curve is named.

    Ratios hardly tell gamma 2.2 from sRGB, which is about that on the whole.
    """
    clean = FILES[model]()
    codes = np.rint(255 * (clean.frames / 255.0) ** (1 / 2.2)).astype(np.uint8)
    result = run_check(clean.altered(frames=codes).write(tmp_path / "faulty.h5"), "images.transfer")
    assert result.outcome == "failed"
    assert any(f"best transfer curve is {curve}" in result.findings[0].message for curve in ("gamma2.2", "srgb"))
    assert (result.measurements[0].value or 0.0) > 1.8


@pytest.mark.parametrize("check", ["images.channels", "images.transfer"])
def test_constant_exposure_is_legal_for_the_log_model(check: str, tmp_path: Path) -> None:
    """Frames 20% darker than radiance are the same to ratios."""
    clean = coloured_log()
    darker = np.rint(clean.frames * 0.8).astype(np.uint8)
    assert run_check(clean.altered(frames=darker).write(tmp_path / "darker.h5"), check).outcome == "passed"


def test_grey_scene_cannot_tell_its_channels(tmp_path: Path) -> None:
    """Without colours neither order nor curve is observable, and the reason says why in words."""
    for name, file in (("log", log_file), ("linear", linear_file)):
        path = file().write(tmp_path / f"{name}.h5")
        for check in ("images.channels", "images.transfer"):
            result = run_check(path, check)
            assert result.outcome == "not_observable"
            assert result.reason.startswith("the channels of the frames are equal or proportional")


def test_frames_of_another_scene_are_left_to_other_checks(tmp_path: Path) -> None:
    """Where frames and events have nothing in common, neither colours nor curve are said to be wrong."""
    path = coloured_log().altered(frames=coloured_frames(replace(LOG, seed=40))).write(tmp_path / "other.h5")
    for check in ("images.channels", "images.transfer"):
        assert run_check(path, check).outcome == "not_observable"
