"""What comes before the pass: stamps scanned, windows cut, decoding ready."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.windows import cut_windows, window_length_ns
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.shared_images import SharedImages
from fedora_qa.sequence.window import Span

_HELD_BYTES_PER_PIXEL: Final = 160
"""What a process holds beside blocks and images, for each pixel of a frame: 50 are what checks remember, 35 what one of
them computes on the way, the rest what they share within a window and what lies unused between arrays. Measured at
1440x1080, all checks."""

_LEAST_SHARE: Final = 0.25
"""Share of the memory that blocks and images may fill at least, where that would leave less."""

_MOST_BYTES: Final = 320 << 20
"""What both may fill at most: the images of five windows. More saves no decoding, as what lies around one is held."""

_BLOCKS_SHARE: Final = 0.85
"""Of what both may fill: decoded blocks; the rest is for what is computed of single images."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A sequence ready to be measured."""

    scanned: Scan
    facts: Facts
    spans: tuple[Span, ...]
    decoder: BlockDecoder
    images: SharedImages
    frame_pixels: int | None
    """Of the largest images; None without any."""


def prepare(sequence: SequenceRows, memory_bytes: int) -> Prepared:
    """Scan the stamps of an open sequence and cut its windows."""
    return ready_to_measure(sequence, scan(sequence, window_length_ns(sequence)), memory_bytes)


def ready_to_measure(sequence: SequenceRows, scanned: Scan, memory_bytes: int) -> Prepared:
    """Cut the windows of an open sequence whose stamps have been scanned."""
    pixels = frame_pixels(sequence.layout)
    left_bytes = max(memory_bytes - _HELD_BYTES_PER_PIXEL * (pixels or 0), _LEAST_SHARE * memory_bytes)
    kept_bytes = min(left_bytes, _MOST_BYTES)
    decoder = BlockDecoder(sequence, scanned, int(_BLOCKS_SHARE * kept_bytes))
    images = SharedImages(int((1 - _BLOCKS_SHARE) * kept_bytes))
    return Prepared(scanned, scanned.facts, cut_windows(scanned), decoder, images, pixels)


def frame_pixels(layout: Layout) -> int | None:
    """Return the pixels of the largest images of a file; None without any."""
    shapes = [binding.shape for key, binding in layout.bindings.items() if DATASETS[key].is_image]
    return max((height * width for _, height, width, *_ in shapes), default=None)
