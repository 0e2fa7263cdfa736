"""Sequences that several tests share."""

from pathlib import Path

import pytest

from tests.support.graphics import require_chromium, require_opengl
from tests.support.sequences import make_sequence


@pytest.fixture(scope="session")
def park_day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean second of the park by day. Tests must not write into it."""
    return make_sequence(tmp_path_factory.mktemp("park") / "park-day.h5", "park-day")


@pytest.fixture(scope="session")
def opengl() -> str:
    """What draws through OpenGL here. Without it the test is skipped, or fails where CI is set."""
    return require_opengl()


@pytest.fixture(scope="session")
def chromium() -> Path:
    """The path of the browser. Without it the test is skipped, or fails where CI is set."""
    return require_chromium()
