"""What comes before the pass: timestamps scanned, windows cut, decoding ready."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.memory_budget import MemoryBudget
from fedora_qa.engine.windows import cut_windows, window_length_ns
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.shared_images import SharedImages
from fedora_qa.sequence.window import Span

_EXPECTED_BYTES_PER_PIXEL: Final = 90
"""Bytes that a process is expected to hold beside blocks, for each pixel of a frame, before ``MemoryBudget`` has
measured them: states of checks, temporary arrays of one check, views of a window, the images below. Measured at
1440x1080 with all checks: 66 bytes in the first three windows, 90 after nine."""

_MOST_BYTES: Final = 320 << 20
"""Most bytes of blocks: those of five windows. More saves no decoding, as these hold the halo of a window."""

_IMAGES_SHARE: Final = 0.1
"""Share of the memory for arrays computed from single images: five of 1440x1080 in float32 for 340 MB."""

_MOST_IMAGES_BYTES: Final = 64 << 20
"""Most bytes of these."""


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

    def forget(self) -> None:
        """Drop what can be decoded and computed again."""
        self.decoder.forget()
        self.images.forget()


def prepare(sequence: SequenceRows, memory_bytes: int) -> Prepared:
    """Scan the timestamps of an open sequence and cut its windows."""
    return ready_to_measure(sequence, scan(sequence, window_length_ns(sequence)), memory_bytes)


def ready_to_measure(sequence: SequenceRows, scanned: Scan, memory_bytes: int) -> Prepared:
    """Cut the windows of an open sequence whose timestamps have been scanned."""
    pixels = frame_pixels(sequence.layout)
    memory_budget = MemoryBudget(memory_bytes, _EXPECTED_BYTES_PER_PIXEL * (pixels or 0))
    decoder = BlockDecoder(sequence, scanned, _MOST_BYTES, memory_budget)
    images = SharedImages(min(int(_IMAGES_SHARE * memory_bytes), _MOST_IMAGES_BYTES))
    return Prepared(scanned, scanned.facts, cut_windows(scanned), decoder, images, pixels)


def frame_pixels(layout: Layout) -> int | None:
    """Return the pixels of the largest images of a file; None without any."""
    shapes = [binding.shape for key, binding in layout.bindings.items() if DATASETS[key].is_image]
    # Axes of images: row of the dataset, height, width and, of colour images, channels.
    return max((height * width for _, height, width, *_ in shapes), default=None)
