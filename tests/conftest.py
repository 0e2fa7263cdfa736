"""Sequences that several tests share."""

from functools import cache
from pathlib import Path

import pytest

from fedora_generator.scene import load_scene
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from tests.support.graphics import require_chromium, require_opengl
from tests.support.sequences import CleanSequence, make_sequence


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands check in the process of the test, which sees what they warn of; tests of processes ask for them."""
    monkeypatch.setenv(IN_PROCESS_VARIABLE, "1")


@pytest.fixture(scope="session")
def clean_sequence(tmp_path_factory: pytest.TempPathFactory) -> CleanSequence:
    """A clean second of any scene, made once a run; half of one of what is flown fast and drawn by software.

    Tests must not write into it.

    Where there is no OpenGL, a test that asks for a scene of meshes is skipped, or fails where CI is set.
    """
    folder = tmp_path_factory.mktemp("clean")

    @cache
    def made(scene: str) -> Path:
        return make_sequence(folder / f"{scene}.h5", scene, 0.5 if scene.startswith("racetrack-mesh") else 1.0)

    def clean(scene: str) -> Path:
        if load_scene(scene).renderer == "mesh":
            require_opengl()
        return made(scene)

    return clean


@pytest.fixture(scope="session")
def park_day(clean_sequence: CleanSequence) -> Path:
    """A clean second of the park by day. Tests must not write into it."""
    return clean_sequence("park-day")


@pytest.fixture(scope="session")
def opengl() -> str:
    """What draws through OpenGL here. Without it the test is skipped, or fails where CI is set."""
    return require_opengl()


@pytest.fixture(scope="session")
def chromium() -> Path:
    """The path of the browser. Without it the test is skipped, or fails where CI is set."""
    return require_chromium()
