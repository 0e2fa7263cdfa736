"""What tests of pictures need of a machine, and what becomes of them where it is missing."""

import os
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NoReturn

import pytest

from fedora_qa.cli.doctor import DrawingTrial, try_pyrender

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")

_LIBRARIES = (
    *("libEGL.so", "libEGL.so.1", "libGL.so", "libGL.so.1", "libGLX.so.0", "libOpenGL.so", "libOpenGL.so.0"),
    *("libGLESv2.so", "libGLESv2.so.2", "libOSMesa.so", "libOSMesa.so.6", "libOSMesa.so.8"),
)


def require_opengl() -> str:
    """Return what draws; where nothing does, skip the test, or fail it where graphics are demanded."""
    trial = _opengl()
    if not trial.works:
        lacking(f"This test draws through OpenGL. {trial.detail}")
    return trial.detail


def require_chromium() -> Path:
    """Return the path of the browser; where there is none, skip the test, or fail it where graphics are demanded."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        lacking("This test opens a report in Chromium, which is not installed: apt install chromium")
    return Path(found)


def lacking(sentence: str) -> NoReturn:
    """Skip the running test and say why; where graphics are demanded, fail it, so that no gap stays unseen."""
    if demanded(os.environ):
        pytest.fail(f"{sentence} (CI or FEDORA_REQUIRE_GRAPHICS is set, so this is no skip)", pytrace=False)
    pytest.skip(sentence)


def demanded(environment: Mapping[str, str]) -> bool:
    """Say whether a machine without graphics is a failure."""
    return any(
        environment.get(name, "").lower() not in {"", "0", "false"} for name in ("CI", "FEDORA_REQUIRE_GRAPHICS")
    )


@cache
def _opengl() -> DrawingTrial:
    return try_pyrender()


def without_opengl(folder: Path) -> dict[str, str]:
    """Return an environment in which no library of OpenGL can be loaded: files that are none lie before them."""
    shadows = folder / "no-opengl"
    shadows.mkdir()
    for name in _LIBRARIES:
        (shadows / name).write_text("not a library\n")
    return {**os.environ, "LD_LIBRARY_PATH": str(shadows)}
