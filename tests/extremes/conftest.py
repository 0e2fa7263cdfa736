"""Sequences that the extremes start from, each made once."""

from pathlib import Path

import pytest

from tests.extremes.files import generated, park
from tests.support.shared_files import SharedFiles


@pytest.fixture(scope="session")
def half_second(shared_files: SharedFiles) -> Path:
    """Half a second of the park by day. Tests must not write into it."""
    return shared_files.file("park-half-second.h5", lambda path: generated(park(), path))
