"""Sequences that the extremes start from, each made once."""

from pathlib import Path

import pytest

from tests.extremes.files import generated, park


@pytest.fixture(scope="session")
def half_second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of the park by day. Tests must not write into it."""
    return generated(park(), tmp_path_factory.mktemp("extremes") / "park.h5")
