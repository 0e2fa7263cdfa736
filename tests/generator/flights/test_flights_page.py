"""The examples of the page on flights."""

import re
from pathlib import Path

import pytest

from fedora_generator.generate import require_free_flight
from fedora_generator.scene import load_scene

PAGE = Path(__file__).parents[3] / "docs" / "flights.md"
EXAMPLES = re.findall(r"^```toml\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def test_the_page_has_examples() -> None:
    """Without any, the next test would prove nothing."""
    assert len(EXAMPLES) == 6


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_an_example_loads_and_meets_nothing(number: int, tmp_path: Path) -> None:
    """Saved as it stands it is a scene whose camera stays free of the world for 20 s."""
    path = tmp_path / "mine.toml"
    path.write_text(EXAMPLES[number])
    require_free_flight(load_scene(path), 20_000_000)
