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

_CACHE_SHARE: Final = 0.4
"""Share of the memory limit that decoded blocks may fill."""

_IMAGES_SHARE: Final = 0.3
"""Share that what is computed of single images may fill; the rest is for everything else that checks compute."""


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
    decoder = BlockDecoder(sequence, scanned, int(_CACHE_SHARE * memory_bytes))
    images = SharedImages(int(_IMAGES_SHARE * memory_bytes))
    return Prepared(scanned, scanned.facts, cut_windows(scanned), decoder, images, frame_pixels(sequence.layout))


def frame_pixels(layout: Layout) -> int | None:
    """Return the pixels of the largest images of a file; None without any."""
    shapes = [binding.shape for key, binding in layout.bindings.items() if DATASETS[key].is_image]
    return max((height * width for _, height, width, *_ in shapes), default=None)
