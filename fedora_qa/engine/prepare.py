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

_HELD_BYTES_PER_PIXEL: Final = 200
"""What a process holds beside blocks and images: what the checks remember (50 bytes a pixel of a frame), what
they share within a window (60), what one of them computes on the way (40), and what all that leaves unused between its
arrays (50); measured at 1440x1080."""

_LEAST_SHARE: Final = 0.25
"""Share of the memory that blocks and images may fill at least, where that would leave less."""

_BLOCKS_SHARE: Final = 0.8
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
    kept_bytes = max(memory_bytes - _HELD_BYTES_PER_PIXEL * (pixels or 0), _LEAST_SHARE * memory_bytes)
    decoder = BlockDecoder(sequence, scanned, int(_BLOCKS_SHARE * kept_bytes))
    images = SharedImages(int((1 - _BLOCKS_SHARE) * kept_bytes))
    return Prepared(scanned, scanned.facts, cut_windows(scanned), decoder, images, pixels)


def frame_pixels(layout: Layout) -> int | None:
    """Return the pixels of the largest images of a file; None without any."""
    shapes = [binding.shape for key, binding in layout.bindings.items() if DATASETS[key].is_image]
    return max((height * width for _, height, width, *_ in shapes), default=None)
