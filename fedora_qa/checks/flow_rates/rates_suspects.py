"""Which rate disagrees with the others, and which fault of it, undone, makes it agree."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_chains import Chain, Change, Composed, Segment, compose, exists
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_rate_agreement import FEWEST_PIXELS, lattice_of, median_error_px
from fedora_qa.views.flow_suspects import gain_suspect, gross_suspects, most_probable

Pair = tuple[str, str]
"""Two rates, the slower one first."""

Float64 = NDArray[np.float64]

_EITHER: Final = 0.7
"""Weight where nothing tells which of two rates is wrong."""

_INNOCENT: Final = 0.1
"""Weight of a rate that agrees with a third."""

_EXACTLY: Final = 0.0
"""Left of the error, px, where fields are another field bit for bit: no chance does that. Where they are not, all is
left."""

_COPIES: Final = ("flow_rate_mixed", "frozen_frames")
"""Faults that are seen bit for bit; what resembles them is then not named."""

_FEWEST_OFF: Final = 4 * FEWEST_PIXELS
"""Pixels from which on those that are off are looked at alone: a quarter of them may leave the image."""

_SAME_GAIN: Final = 0.02
_WEAK: Final = 0.02
"""Joins a finding to a cause for which there is stronger evidence elsewhere."""

_CAUSES: Final = (
    "flow_gain", "flow_unit", "flow_sign", "flow_interval_shifted", "flow_rate_mixed", "axes_swapped",
    "frame_convention", "mirrored", "spatial_offset", "swapped_frames", "frozen_frames", "other_sequence",
    "time_offset", "intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "nan_in_stream", "clock_rate",
    "time_unit", "unsorted", "duplicated_samples",
)  # fmt: skip

_CHANGES: Final[tuple[tuple[str, Change], ...]] = (
    ("flow_sign", lambda flow_px: -flow_px),
    ("axes_swapped", lambda flow_px: flow_px[..., ::-1]),
    ("frame_convention", lambda flow_px: flow_px * np.array([1, -1], dtype=flow_px.dtype)),
    ("mirrored", lambda flow_px: flow_px[:, ::-1]),
    ("mirrored", lambda flow_px: flow_px[::-1]),
)
"""What undoes a fault of the stored numbers or of their grid."""


@dataclass(frozen=True, slots=True)
class _Undone:
    """A fault of one rate, or of ``flow``, and the median error in px that is left after undoing it."""

    stream: str
    cause: str
    left_px: float
    magnitude: float | None = None


def weigh_hypotheses(window: Window, segment: Segment) -> list[ConventionTrial]:
    """Weigh faults of either rate, and of both, against one segment: the share of the error that undoing removes."""
    columns, rows = _pixels_off(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    moved_px = np.linalg.norm(slow.displacement_px[slow.clear], axis=-1)
    reference_px = min(median_error_px(slow, fast), float(np.median(moved_px)) if len(moved_px) else np.inf)
    best: dict[tuple[str, str], ConventionTrial] = {}
    for one in (
        *_of_one_rate(window, segment, slow, fast, (columns, rows)),
        *_of_both(window, segment, (columns, rows)),
    ):
        weight = max(1.0 - one.left_px / reference_px, 0.0) if reference_px > 0 else 0.0
        key = one.stream, one.cause
        if key not in best or best[key].removed_share < weight:
            best[key] = ConventionTrial(one.stream, one.cause, one.stream, weight, one.magnitude)
    return list(best.values())


def _pixels_off(window: Window, segment: Segment) -> tuple[Float64, Float64]:
    """Return pixels of the lattice that are off, where they are few: a fault of a part of the image. All otherwise."""
    columns, rows = lattice_of(window, segment)
    slow, fast = (compose(window, chain, columns, rows) for chain in (segment.slow, segment.fast))
    compared = slow.clear & slow.stays & fast.clear & fast.stays
    apart_px = np.where(compared[:, None], slow.displacement_px - fast.displacement_px, 0.0)
    off = np.linalg.norm(apart_px, axis=-1) > np.where(compared, slow.bound_px + fast.bound_px, 0.0)
    if _FEWEST_OFF <= np.count_nonzero(off) < 0.5 * np.count_nonzero(compared):
        return columns[off], rows[off]
    return columns[::4], rows[::4]


def rates_suspects(pair: Pair, off: Mapping[Pair, float], weighed: Sequence[ConventionTrial]) -> tuple[Suspect, ...]:
    """Return the suspects for one pair of rates, most probable first.

    ``off`` is the share of the common intervals of each pair that are off.
    """
    copies = _copied(weighed)
    weighed = [one for one in weighed if one.stream not in copies or one.transform in _COPIES]
    found: list[Suspect] = []
    for stream in pair:
        blame = _blame(stream, pair, off)
        found += [
            replace(suspect, weight=blame * suspect.weight)
            for suspect in gross_suspects(stream, weighed, stream, share_off=off[pair])
        ]
    if all(off.values()):
        found += gross_suspects("flow", weighed, "flow", share_off=off[pair])
        mixed = {one.stream for one in weighed if one.transform == "flow_rate_mixed" and one.removed_share > 0}
        found += [Suspect("flow_rate_mixed", "flow", 1.0)] if len(mixed) > 2 else []
    named = most_probable(found)
    known = {(one.cause, one.stream) for one in named}
    streams = ("flow", *pair) if all(off.values()) else pair
    others = (Suspect(cause, stream, _WEAK) for stream in streams for cause in _CAUSES)
    return named + tuple(one for one in others if (one.cause, one.stream) not in known)


def _copied(weighed: Sequence[ConventionTrial]) -> set[str]:
    """Return the streams that a copy explains wherever they were looked at."""
    weights: dict[Pair, list[float]] = {}
    for one in weighed:
        if one.transform in _COPIES:
            weights.setdefault((one.stream, one.transform), []).append(one.removed_share)
    return {stream for (stream, _), found in weights.items() if min(found) == 1.0}


def _blame(stream: str, pair: Pair, off: Mapping[Pair, float]) -> float:
    """Weigh how probably a rate is the wrong one of a pair: by whether each of the two agrees with a third rate."""
    agrees = {one: any(one in other and not share for other, share in off.items()) for one in pair}
    if agrees[stream]:
        return _INNOCENT
    other = pair[1] if stream == pair[0] else pair[0]
    return 1.0 if agrees[other] else _EITHER


def _of_one_rate(
    window: Window, segment: Segment, slow: Composed, fast: Composed, pixels: tuple[Float64, Float64]
) -> Iterator[_Undone]:
    """Undo faults of either rate."""
    for chain, own, other in ((segment.slow, slow, fast), (segment.fast, fast, slow)):
        stream, seconds = chain.stream, _interval_s(segment, chain)
        for cause, change in _CHANGES:
            yield _Undone(stream, cause, median_error_px(compose(window, chain, *pixels, change), other))
        for shift in (-1, 1):
            if exists(window.facts, chain.shifted(shift)):
                left_px = median_error_px(compose(window, chain.shifted(shift), *pixels), other)
                yield _Undone(stream, "flow_interval_shifted", left_px, float(shift))
                yield _Undone(stream, "swapped_frames", left_px, 1.0)
        for factor in _factors(seconds, own, other):
            named = gain_suspect(stream, factor - 1, None, 1.0, seconds, _SAME_GAIN)
            left_px = median_error_px(compose(window, chain, *pixels, _divided_by(factor)), other)
            yield _Undone(stream, named.cause, left_px, named.magnitude)
        yield _Undone(stream, "flow_rate_mixed", _EXACTLY if _holds_another(window, chain) else np.inf)
        repeated = _repeated(window, chain)
        yield _Undone(stream, "frozen_frames", _EXACTLY if repeated else np.inf, float(repeated))


def _of_both(window: Window, segment: Segment, pixels: tuple[Float64, Float64]) -> Iterator[_Undone]:
    """Undo the same fault of both rates."""
    for cause, change in _CHANGES:
        slow, fast = (compose(window, chain, *pixels, change) for chain in (segment.slow, segment.fast))
        yield _Undone("flow", cause, median_error_px(slow, fast))


def _divided_by(factor: float) -> Change:
    return lambda flow_px: flow_px / np.float32(factor)


def _interval_s(segment: Segment, chain: Chain) -> float:
    return (segment.end_ns - segment.start_ns) / len(chain.rows) / NS_PER_S


def _factors(seconds: float, own: Composed, other: Composed) -> Iterator[float]:
    """Yield factors by which a rate may be too large: a change of unit, and the one that fits."""
    yield from (seconds, 1 / seconds) if seconds > 0 else ()
    both = own.clear & own.stays & other.clear & other.stays
    mine_px, theirs_px = own.displacement_px[both], other.displacement_px[both]
    square = float(np.sum(theirs_px**2))
    factor = float(np.sum(mine_px * theirs_px)) / square if square > 0 else 0.0
    yield from (factor,) if factor > 0 else ()


def _holds_another(window: Window, chain: Chain) -> bool:
    """Whether the chain's first field equals the field of another rate at its start or row."""
    row = chain.rows[0]
    own, start_ns = window.flow_px(chain.stream, row), window.facts.clocks[chain.stream].times_ns[row]
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == chain.stream or not len(starts_ns):
            continue
        latest = max(int(np.searchsorted(starts_ns, start_ns, "right")) - 1, 0)
        others = (window.flow_px(stream, other) for other in {latest, min(row, len(starts_ns) - 1)})
        if any(_same(own, other) for other in others):
            return True
    return False


def _repeated(window: Window, chain: Chain) -> int:
    """Count the repetitions in the longest run of equal fields that touches the chain, up to a window beyond it."""
    reach = len(window.owned(chain.stream))
    first = max(chain.rows[0] - reach, 0)
    last = min(chain.rows[-1] + reach, len(window.facts.clocks[chain.stream].times_ns) - 1)

    def repeats(row: int) -> bool:
        return first < row <= last and _same(window.flow_px(chain.stream, row), window.flow_px(chain.stream, row - 1))

    longest = 0
    for row in chain.rows:
        if repeats(row):
            after = next(later for later in range(row + 1, last + 2) if not repeats(later))
            before = next(earlier for earlier in range(row - 1, first - 1, -1) if not repeats(earlier))
            longest = max(longest, after - before - 1)
    return longest


def _same(one: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether two fields are equal bit for bit, without being empty or zero throughout."""
    return np.array_equal(one, other, equal_nan=True) and bool(np.any(np.nan_to_num(one)))
