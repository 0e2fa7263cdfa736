"""A machine without graphics: tests that need them say what is missing, and in CI they fail."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import graphics
from tests.support.graphics import demanded, lacking, require_chromium, without_opengl

ROOT = Path(__file__).parents[1]


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """An environment that demands nothing."""
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.delenv("FEDORA_REQUIRE_GRAPHICS", raising=False)
    return monkeypatch


def test_what_is_missing_skips(bare: pytest.MonkeyPatch) -> None:
    """On anybody's machine a test without its library is skipped, with the sentence as reason."""
    with pytest.raises(pytest.skip.Exception, match="install it like this"):
        lacking("install it like this")


@pytest.mark.parametrize("variable", ["CI", "FEDORA_REQUIRE_GRAPHICS"])
def test_what_is_missing_fails_where_it_is_demanded(bare: pytest.MonkeyPatch, variable: str) -> None:
    """Where CI is set nothing is skipped."""
    bare.setenv(variable, "true")
    with pytest.raises(pytest.fail.Exception, match="install it like this"):
        lacking("install it like this")


@pytest.mark.parametrize(
    ("environment", "expected"),
    [({}, False), ({"CI": ""}, False), ({"CI": "false"}, False), ({"CI": "1"}, True), ({"CI": "True"}, True)],
)
def test_demanded(environment: dict[str, str], expected: bool) -> None:
    """CI counts unless it is empty, 0 or false."""
    assert demanded(environment) is expected


def test_no_browser(bare: pytest.MonkeyPatch) -> None:
    """Without Chromium the reason names its package."""
    bare.setattr(graphics.shutil, "which", lambda _: None)
    with pytest.raises(pytest.skip.Exception, match="apt install chromium"):
        require_chromium()


@pytest.mark.parametrize(("ci", "outcome"), [("", "1 skipped"), ("true", "1 error")])
def test_fixture_where_opengl_cannot_be_loaded(tmp_path: Path, ci: str, outcome: str) -> None:
    """A test that asks for ``opengl`` really is skipped, or fails, on a machine whose libraries cannot be loaded."""
    test = tmp_path / "test_one.py"
    test.write_text("from tests.conftest import opengl\n\ndef test_one(opengl):\n    pass\n")
    options = ["-p", "no:cacheprovider", "-o", "addopts=", "--rootdir", str(tmp_path), "-ra"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, str(test)],
        env={**without_opengl(tmp_path), "CI": ci, "FEDORA_REQUIRE_GRAPHICS": ""},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert outcome in done.stdout
    assert "libegl1 libgl1 libgl1-mesa-dri" in done.stdout
