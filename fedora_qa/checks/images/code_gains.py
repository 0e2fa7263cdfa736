"""Frames that were multiplied after they had been rounded to 8 bits."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.estimators.images.code_gain import CodeGain, could_betray, gain_after_rounding
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts

WindowCodes = tuple[range, NDArray[np.int64]]
"""The frames of a window, and how often each code (256,) occurs in them."""

_RGB: Final = "rgb"


def frames_with_gain(windows: Sequence[WindowCodes], facts: Facts) -> Iterator[Statistic]:
    """Count the frames whose codes betray a gain: of all windows together, or else of each; nothing where none could.

    A gain of a part of the file shows only in that part, as the codes that it leaves out occur elsewhere.
    """
    together = np.sum([codes for _, codes in windows], axis=0) if windows else np.zeros(256, dtype=np.int64)
    if not could_betray(together):
        return
    everywhere = gain_after_rounding(together)
    found = [
        (frames, gain)
        for frames, codes in windows
        if len(frames) and (gain := everywhere or gain_after_rounding(codes)) is not None
    ]
    yield _stated(found, facts)


def _stated(found: Sequence[tuple[range, CodeGain]], facts: Facts) -> Statistic:
    where, statement, suspects = Where(stream=_RGB), "", tuple[Suspect, ...]()
    if found:
        first, last = found[0][0].start, found[-1][0].stop - 1
        gain = min((one for _, one in found), key=lambda one: one.half_range)
        percent, error = 100 * (gain.gain - 1), 100 * gain.half_range
        times_ns = facts.clocks[_RGB].times_ns
        start_us, stop_us = (facts.to_file_us(int(times_ns[row])) for row in (first, last))
        where = Where(_RGB, start_us, stop_us, index_start=first, index_stop=last + 1, frame=first)
        statement = (
            f"Frames {first} to {last} were made {percent:+.4g} +/- {error:.2g}% brighter after they had been rounded "
            "to 8 bits: just the codes that this leaves out are missing, or those that it puts on another doubled."
        )
        suspects = (Suspect("exposure_or_gamma", _RGB, 0.95, percent, "percent", error),)
    return Statistic(
        name="frames_with_gain_after_rounding",
        value=float(sum(len(frames) for frames, _ in found)),
        unit="frames",
        standard_error=0.0,
        resolution=1.0,
        statement=statement,
        code="images.exposure.rounded_before",
        where=where,
        suspects=suspects,
    )
