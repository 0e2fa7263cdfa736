"""The page can be read in light and dark."""

import re
from importlib.resources import files

import pytest

CSS = (files("fedora_reports") / "templates" / "style.css").read_text(encoding="utf-8")
WORDS = ("ink", "muted", "link", "good", "bad", "warn", "odd", "none")


def colours(scheme: str) -> dict[str, str]:
    """The colours of a scheme by their names; what dark does not change is as in light."""
    light, dark = (dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block)) for block in _blocks()[:2])
    return light if scheme == "light" else light | dark


def _blocks() -> list[str]:
    return re.findall(r":root \{(.*?)\}", CSS, flags=re.DOTALL)


def luminance(colour: str) -> float:
    """Relative luminance as WCAG 2.2 defines it."""
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(first: str, second: str) -> float:
    """Contrast ratio as WCAG 2.2 defines it, 1 to 21."""
    low, high = sorted((luminance(first), luminance(second)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_of_black_and_white() -> None:
    """The published extremes."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("ground", ["paper", "raised"])
def test_words_stand_out(scheme: str, word: str, ground: str) -> None:
    """Every colour of text reaches 4.5 against every ground."""
    known = colours(scheme)
    assert contrast(known[word], known[ground]) >= 4.5


def test_style_asks_for_nothing() -> None:
    """No font, picture or sheet is loaded."""
    assert not re.search(r"url\(|@import|@font-face", CSS)
