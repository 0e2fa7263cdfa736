"""What is dropped first, held against the order in which nothing better could be dropped."""

from collections.abc import Callable, Sequence
from itertools import count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.layout.binding import Memory
from fedora_qa.sequence.window import Span
from tests.support.films import IMAGE_BYTES, NOTHING_SCANNED, Films, images_of

WINDOWS = 40
AHEAD_EVERY, AHEAD_IMAGES = 4, 6
"""Every fourth window a check looks as far ahead, as flow of a low rate is composed of that of a high one."""

Victim = Callable[[Sequence[int], int], int]


def asked_in(window: int) -> list[int]:
    """Return the images that checks ask for, one check after the other, as those of a file with several rates do."""
    own = [2 * window, 2 * window + 1]
    composed = [2 * window + ahead for ahead in range(AHEAD_IMAGES)] if window % AHEAD_EVERY == 0 else []
    return [*own, *own, own[-1] + 1, *composed, *own, own[-1] + 1, *own]


ASKED = [image for window in range(WINDOWS) for image in asked_in(window)]


def decoded_if(victim: Victim, images: int) -> int:
    """Return how many images are decoded where those that are kept, the longest unused first, lose the victim."""
    kept, decoded = list[int](), 0
    for now, image in enumerate(ASKED):
        if image in kept:
            kept.remove(image)
        else:
            decoded += 1
            if len(kept) == images:
                kept.remove(victim(kept, now))
        kept.append(image)
    return decoded


def longest_unused(kept: Sequence[int], now: int) -> int:
    """Return what most caches drop."""
    return kept[0]


def wanted_last(kept: Sequence[int], now: int) -> int:
    """Return what is best dropped by who knows the future (Belady 1966)."""
    return max(kept, key=lambda image: next(at for at in count(now + 1) if at >= len(ASKED) or ASKED[at] == image))


def decoded_by_decoder(images: int) -> int:
    decoder = BlockDecoder(Films(), NOTHING_SCANNED, images * IMAGE_BYTES)
    decoded = 0
    for window in range(WINDOWS):
        decoder.begin(Span(window, window, window + 1, {"depth": (2 * window, 2 * window + 2)}))
        decoded += images_of(decoder, *asked_in(window))
    return decoded


@pytest.mark.parametrize("images", [3, 4, 5])
def test_no_more_is_decoded_than_must_be(images: int) -> None:
    """Where too few fit, it is as good as if the future were known, where the longest unused going first is not."""
    least = decoded_if(wanted_last, images)
    assert decoded_by_decoder(images) == least
    assert decoded_if(longest_unused, images) > least


def test_nothing_is_decoded_twice_where_all_fits() -> None:
    """With room for all that one window and the next ask for, each image is decoded once."""
    assert decoded_by_decoder(AHEAD_IMAGES + 1) == len(set(ASKED))


class TwoFilms(Films):
    """Colour images of twice the size as well."""

    layout: Any = SimpleNamespace(bindings={key: SimpleNamespace(rows=100) for key in ("path/depth", "path/rgb")})

    def rows(self, key: str, start: int, stop: int, memory: Memory | None = None) -> NDArray[Any]:
        return np.repeat(super().rows(key, start, stop), 2 if key == "path/rgb" else 1, axis=1)


@pytest.mark.parametrize(("wanted", "dropped"), [("path/depth", ("path/depth", 0)), ("path/rgb", ("path/rgb", 0))])
def test_of_what_lies_behind_a_block_as_large_goes_first(wanted: str, dropped: tuple[str, int]) -> None:
    """Its pages are those that the next block is decoded into: none are given back, and no fresh ones taken."""
    decoder = BlockDecoder(TwoFilms(), NOTHING_SCANNED, 7 * IMAGE_BYTES)
    decoder.begin(Span(0, 0, 1, {"depth": (0, 2), "rgb": (0, 2)}))
    for key in ("path/rgb", "path/depth"):
        for image in range(2):
            decoder.rows(key, image, image + 1)
    decoder.begin(Span(1, 1, 2, {"depth": (2, 4), "rgb": (2, 4)}))
    decoder.rows("path/depth", 2, 3)  # fills what is left
    held = decoder.held_bytes
    decoder.rows(wanted, 3, 4)
    assert dropped not in decoder._cached
    assert len(decoder._cached) == 5
    assert decoder.held_bytes == held == 7 * IMAGE_BYTES
