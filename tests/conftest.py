"""Sequences that several tests share."""

import functools
import gc
import os
import pickle
from collections.abc import Generator, Iterator
from pathlib import Path

import cv2
import pytest
from hypothesis import HealthCheck, settings

from fedora_generator.mesh import places
from fedora_generator.mesh.model import MeshModel
from fedora_generator.scene import load_scene
from fedora_generator.threads import NUMBA_CONFIG
from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from tests.support.graphics import require_chromium, require_opengl
from tests.support.sequences import (
    CLEAN_PART_S,
    CLEAN_S,
    CLEAN_SIZE_PX,
    CLEAN_SIZES_PX,
    CleanSequence,
    make_sequence,
)
from tests.support.shared_files import SharedFiles

# No test depends on the speed of the machine. All else is as in the profile in force: in CI draws are alike each time.
settings.register_profile("untimed", settings(), deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for garbage once after ten thousand tests are collected, and no more among what lives until the end."""
    gc.disable()
    collected = yield
    gc.collect()
    gc.freeze()
    gc.enable()
    return collected


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands check in the process of the test, which sees what they warn of; tests of processes ask for them."""
    monkeypatch.setenv(IN_PROCESS_VARIABLE, "1")


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Limit each process of a test run to one thread; tests of threads set another number."""
    NUMBA_CONFIG.NUMBA_NUM_THREADS = 1
    cv2.setNumThreads(1)


@pytest.fixture(scope="session")
def shared_files(tmp_path_factory: pytest.TempPathFactory) -> SharedFiles:
    """Files that are written once a run, whichever process needs them first."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        # Each process has a folder of its own within that of the run.
        folder = folder.parent
    (folder / "shared").mkdir(exist_ok=True)
    return SharedFiles(folder / "shared")


@pytest.fixture(autouse=True, scope="session")
def places_built_once(shared_files: SharedFiles) -> Iterator[None]:
    """Build each place of meshes once a run: it takes seconds, and all scenes of a place need the same."""
    build = places.build_place

    @functools.cache
    def built(name: str, seed: int) -> MeshModel:
        path = shared_files.file(
            f"{name}-{seed}.pickle", lambda path: path.write_bytes(pickle.dumps(build(name, seed)))
        )
        model: MeshModel = pickle.loads(path.read_bytes())
        return model

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(places, "build_place", built)
        yield


@pytest.fixture(scope="session")
def clean_sequence(shared_files: SharedFiles) -> CleanSequence:
    """Part of a second of any scene, clean, as each test run writes it once.

    Where there is no OpenGL, a test that asks for a scene of meshes is skipped, or fails where CI is set.
    """

    def clean(scene: str) -> Path:
        renderer = load_scene(scene).renderer
        if renderer == "mesh":
            require_opengl()
        duration_s = CLEAN_S.get(scene, CLEAN_PART_S[renderer])
        width, height = CLEAN_SIZES_PX.get(scene, CLEAN_SIZE_PX[renderer])
        return shared_files.file(
            f"{scene}-short.h5", lambda path: make_sequence(path, scene, duration_s, width, height)
        )

    return clean


@pytest.fixture(scope="session")
def park_day(shared_files: SharedFiles) -> Path:
    """A clean second of the park by day. Tests must not write into it."""
    return shared_files.file("park-day.h5", lambda path: make_sequence(path, "park-day"))


@pytest.fixture(scope="session")
def small_park_day(clean_sequence: CleanSequence) -> Path:
    """0.6 s of the park by day, 198 x 147, clean. Tests must not write into it."""
    return clean_sequence("park-day")


@pytest.fixture(scope="session")
def tiny_park_day(shared_files: SharedFiles) -> Path:
    """0.3 s of the park by day, 90 x 68, clean. Tests must not write into it."""
    return shared_files.file("tiny-park-day.h5", lambda path: make_sequence(path, "park-day", 0.3, 90, 68))


@pytest.fixture(scope="session")
def tiny_park_noisy(shared_files: SharedFiles) -> Path:
    """0.1 s of the park with every noise, 90 x 68, clean. Tests must not write into it."""
    return shared_files.file("tiny-park-noisy.h5", lambda path: make_sequence(path, "park-noisy", 0.1, 90, 68))


@pytest.fixture(scope="session")
def opengl() -> str:
    """What draws through OpenGL here. Without it the test is skipped, or fails where CI is set."""
    return require_opengl()


@pytest.fixture(scope="session")
def chromium() -> Path:
    """The path of the browser. Without it the test is skipped, or fails where CI is set."""
    return require_chromium()
