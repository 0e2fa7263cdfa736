"""Gains of brightness between frames, and gains or power laws applied to values after rounding.

Two frames that show the same points: in each tile, the logarithm of the ratio of sums; then the median over tiles.
Moving, new or shining objects disturb some tiles, exposure changes all. Sums are used in place of means of logarithms,
since rounding averages out of sums.

One histogram of values of 8 bits: a gain after rounding leaves codes that cannot occur. Codes k times a gain g, rounded
again, omit every code between rint(g k) and rint(g (k + 1)) where g > 1, and put two codes on one where g < 1. In a
histogram of many values neighbouring codes are about equally frequent. A code without any value among frequent ones, or
one twice as frequent, is therefore no chance event. It is even less likely that all such codes, and no others, are
those of one gain: m of n codes are one given set with probability one over n choose m. A scene of few flat colours
has some codes far more frequent than their neighbours, and other codes absent: no gain below 1 does both.

With g > 1 the j-th omitted code c lies between those of k = c - j and k + 1. With g < 1 the j-th doubled code c has
those of k = c + j - 1 and k + 1. Rounding then bounds the gain by each such code::

    (c + 1/2) / (c - j + 1) <= g <= (c - 1/2) / (c - j),        (c - 1/2) / (c + j - 1) <= g <= (c + 1/2) / (c + j)

A power law after rounding, ``rint(255 (k / 255)^e)`` of the codes k, omits codes where the curve is steep: in the dark
for an exponent below 1, near white for one above 1. Which codes are omitted depends on the exponent alone. In a
histogram of many values, a code without any value between frequent ones is no chance event, and that just the codes of
one exponent are absent is less likely still: of n codes, h or more of the m that an exponent omits are among the k
absent ones with a hypergeometric probability.
"""

from dataclasses import dataclass
from math import comb
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import robust_sigma
from fedora_qa.estimators.images.luma import WHITE_DN

Bools = NDArray[np.bool_]
Float64 = NDArray[np.float64]

TILES: Final = (9, 12)
"""Rows and columns of tiles."""

FEWEST_TILES: Final = 12
FEWEST_PIXELS: Final = 4
"""Tiles, and pixels in a tile, below which no gain is estimated."""

LEVELS_DN: Final = (8.0, 240.0)
"""Range of the geometric mean of both frames in which a pixel counts: it is then neither lost in rounding nor clipped.

The mean of both frames is used and not one of them, so that the choice favours neither direction.
"""

_MEDIAN_EFFICIENCY: Final = float(np.sqrt(np.pi / 2))
"""Ratio of the standard error of a median to that of a mean, for normal values."""

CODES: Final = 256

_FREQUENT: Final = 50
"""Least count of both neighbours of a code: the code itself is then absent by chance once in e^50 (Poisson)."""

_FREQUENT_TWICE: Final = 400
"""Least count for a doubled code: counts scatter by 5%, so that once and twice differ by about eight standard
deviations."""

_FEWEST_CODES: Final = 40
_FEWEST_MARKS: Final = 3
_FEWEST_ABSENT: Final = 5
"""Least number of frequent codes, of marked ones among them for a gain, and of absent ones for a power law: 40 choose 3
is 9880, a hundred gains are tried, and each code without any value among frequent ones is itself rare."""

_FIRST: Final = 2
"""The first code that is used; values at 0 and 255 are clipped."""

_TWICE: Final = 1.5
"""Ratio to the counts of both neighbours above which a code counts as doubled: about half-way between once and
twice."""

_LARGEST_RANK: Final = 100
"""Largest number of omitted or doubled codes up to the first frequent one: a gain of a factor 1.6 in a bright scene."""

_TIES: Final = 1 + 1e-12
"""Gains of whole percents put codes exactly half-way; the bounds are then equal except for the last bits."""

_EXPONENTS: Final = np.geomspace(0.2, 5.0, 3001)
_FINE: Final = np.linspace(-1.0, 1.0, 201)
"""Exponents that are tried, in steps of 0.1%; then others within a step of the best, a hundredth of a step apart."""

_STEP: Final = float(_EXPONENTS[1] / _EXPONENTS[0] - 1)

_LEAST_AGREEMENT: Final = 0.95
"""Least share of the codes that are absent, or omitted, which are both: some codes are rarer than their neighbours."""

_CHANCE: Final = 1e-9
"""Largest probability of that agreement by chance, for all exponents that are tried together."""


@dataclass(frozen=True, slots=True)
class BrightnessGain:
    """Gain of brightness between two images.

    Attributes
    ----------
    log_gain
        Natural logarithm of later over earlier brightness.
    standard_error
        Of the logarithm, from the spread over tiles.
    corner_log_gain
        The logarithm in the corners, where it grows with the squared distance from the middle of the image: the factor
        by which vignetting begins or ends.
    corner_evidence
        Natural logarithm of the likelihood of such a gain over that of an even one; positive for vignetting.
    """

    log_gain: float
    standard_error: float
    corner_log_gain: float = 0.0
    corner_evidence: float = 0.0


def brightness_gain(before_dn: NDArray[np.floating], after_dn: NDArray[np.floating]) -> BrightnessGain | None:
    """Return the gain between two images of the same points.

    Parameters
    ----------
    before_dn, after_dn
        (h, w) DN, NaN where a point is not visible in both.

    Returns
    -------
    BrightnessGain or None
        None where too few tiles are bright and not clipped.
    """
    before, after = (np.ascontiguousarray(image) for image in (before_dn, after_dn))
    pixels, before_sums, after_sums = _sums_of_tiles(before, after, TILES, LEVELS_DN[0] ** 2, LEVELS_DN[1] ** 2)
    usable = pixels >= FEWEST_PIXELS
    if np.count_nonzero(usable) < FEWEST_TILES:
        return None
    sums = before_sums[usable], after_sums[usable]
    log_gains = np.log(sums[1] / sums[0])
    median = float(np.median(log_gains))
    scatter = float(robust_sigma(log_gains, median))
    # Where nothing moves, rounding remains: uniform over a step in either frame, of variance 1/12 DN^2 for each pixel.
    rounding = float(np.sqrt(np.mean(pixels[usable] * (1 / 12) * (1 / sums[0] ** 2 + 1 / sums[1] ** 2))))
    error = _MEDIAN_EFFICIENCY * max(scatter, rounding) / float(np.sqrt(len(log_gains)))
    return BrightnessGain(median, error, *_towards_corners(log_gains, np.flatnonzero(usable), rounding))


def _towards_corners(log_gains: Float64, tiles: NDArray[np.intp], rounding: float) -> tuple[float, float]:
    """Return the logarithm of a gain in the corners, and its evidence against an even gain, by sums of residuals.

    Both models have one number, m (1 in every tile) and s r^2 (r^2 = 1 in the corner): the medians that leave least
    absolute residuals, so that moving objects disturb neither. Of errors of a Laplace distribution of unknown width,
    the likelihood of n tiles is proportional to (sum of residuals)^-n.
    """
    rows, columns = np.divmod(tiles, TILES[1])
    # Distances of tiles from the middle of the image, 1 at its edge, and their squares, 1 in the corner.
    down, right = (2 * (index + 0.5) / count - 1 for index, count in zip((rows, columns), TILES, strict=True))
    height, width = TILES
    squares = ((down * height) ** 2 + (right * width) ** 2) / (height**2 + width**2)
    # sum |y - s r^2| = sum r^2 |y / r^2 - s|: the median of y / r^2 with weights r^2.
    slopes = log_gains / squares
    order = np.argsort(slopes)
    weights = np.cumsum(squares[order])
    corner = float(slopes[order[int(np.searchsorted(weights, weights[-1] / 2))]])
    even_residual, corner_residual = (
        float(np.mean(np.abs(residuals))) + rounding
        for residuals in (log_gains - np.median(log_gains), log_gains - corner * squares)
    )
    return corner, len(log_gains) * float(np.log(even_residual / corner_residual))


@njit(cache=True)
def _sums_of_tiles(
    before: NDArray[np.floating], after: NDArray[np.floating], tiles: tuple[int, int], least: float, most: float
) -> tuple[NDArray[np.int64], Float64, Float64]:
    """Return the number of pixels of each tile that count, and the sums of both images over them: (n,) each.

    Tiles are in order of rows. Pixels count where the product of both images lies between ``least`` and ``most``.
    """
    height, width = before.shape
    count = tiles[0] * tiles[1]
    pixels, before_sums, after_sums = np.zeros(count, np.int64), np.zeros(count), np.zeros(count)
    for row in range(height):
        first = row * tiles[0] // height * tiles[1]
        for column in range(width):
            earlier, later = np.float64(before[row, column]), np.float64(after[row, column])
            square = earlier * later
            if earlier > 0 and later > 0 and least <= square <= most:
                tile = first + column * tiles[1] // width
                pixels[tile] += 1
                before_sums[tile] += earlier
                after_sums[tile] += later
    return pixels, before_sums, after_sums


@dataclass(frozen=True, slots=True)
class CodeGain:
    """A gain after rounding.

    Attributes
    ----------
    gain
        Middle of the gains that give the same codes.
    half_range
        Half the range of these gains.
    """

    gain: float
    half_range: float


def is_informative(counts: NDArray[np.integer]) -> bool:
    """Return whether enough codes of a histogram (256,) are frequent for a gain to be estimated."""
    values = np.asarray(counts, dtype=np.int64)
    return bool(np.count_nonzero(np.minimum(values[1:-3], values[3:-1]) >= _FREQUENT) >= _FEWEST_CODES)


def gain_after_rounding(counts: NDArray[np.integer]) -> CodeGain | None:
    """Return the gain by which values were multiplied after they had been rounded.

    Parameters
    ----------
    counts
        (256,) number of values of each code. The ends, 0 and 255, where values are clipped, are left out.

    Returns
    -------
    CodeGain or None
        None where the codes are those of no gain.
    """
    if not is_informative(counts):
        return None
    values = np.asarray(counts, dtype=np.int64)
    before, middle, after = values[1:-3], values[2:-2], values[3:-1]
    fewest, most = np.minimum(before, after), np.maximum(before, after)
    absent = (middle == 0) & (fewest >= _FREQUENT)
    # A gain above 1 leaves codes out; one below 1 puts two codes on one and leaves none out.
    if absent.any():
        return _gain_of_pattern(absent, fewest >= _FREQUENT, 1)
    return _gain_of_pattern(middle > _TWICE * most, fewest >= _FREQUENT_TWICE, -1)


def _gain_of_pattern(marked: Bools, frequent: Bools, sign: int) -> CodeGain | None:
    """Return the gain whose marks on the frequent codes are those of ``marked``; None where there is none.

    Both masks are those of the codes 2 to 253. The gain is above 1 for sign 1 and below 1 for sign -1.
    """
    codes = np.flatnonzero(marked & frequent) + _FIRST
    if len(codes) < _FEWEST_MARKS:
        return None
    # The first marked code is the j-th of all: j is unknown, as codes before it may be rare.
    for first_rank in range(1, _LARGEST_RANK):
        # Bounds of the gains that can mark all of the codes. The rank of each further code follows from the bounds of
        # the codes before it: there may be marks on rare codes between.
        low, high, rank = 0.0, np.inf, first_rank
        for code in codes.tolist():
            if high < np.inf:
                gain = 0.5 * (low + high)
                rank = round(sign * (code - 0.5 * (sign > 0)) * (gain - 1) / gain + 0.5)
            source = code - sign * rank
            if source <= 0:
                low, high = 1.0, 0.0
                break
            # The bounds of the module's docstring, c being ``code`` and j ``rank``.
            if sign > 0:
                edges = (code + 0.5) / (source + 1), (code - 0.5) / source
            else:
                edges = (code - 0.5) / (source - 1), (code + 0.5) / source
            low, high = max(low, edges[0]), min(high, edges[1])
        if low > high * _TIES:
            continue
        gain = 0.5 * (low + high)
        reached = np.rint(gain * np.arange(CODES)).astype(np.int64)
        hits = np.bincount(reached[(reached >= 0) & (reached < CODES)], minlength=CODES)
        pattern = (hits == 0 if sign > 0 else hits > 1)[_FIRST : _FIRST + len(frequent)]
        if np.array_equal(pattern[frequent], marked[frequent]):
            return CodeGain(gain, 0.5 * abs(high - low))
    return None


def exponent_after_rounding(counts: NDArray[np.integer]) -> float | None:
    """Return the exponent of the power law through which values went after they had been rounded.

    Parameters
    ----------
    counts
        (256,) number of values of each code. The ends, 0 and 255, stay as they are under any exponent.

    Returns
    -------
    float or None
        None where the codes are those of no exponent.
    """
    values = np.asarray(counts, dtype=np.float64)
    occupied = np.flatnonzero(values)
    if len(occupied) < 2:
        return None
    codes = np.arange(CODES)
    above = np.clip(np.searchsorted(occupied, codes, "right"), 1, len(occupied) - 1)
    below_code, above_code = occupied[above - 1], occupied[above]
    # Between two occupied codes values are shared by all codes up to the upper one.
    shared = np.minimum(values[below_code], values[above_code]) / np.maximum(above_code - below_code, 1)
    inside = (codes > occupied[0]) & (codes < occupied[-1])
    absent = inside & (values == 0) & (shared >= _FREQUENT)
    compared = absent | (inside & (values >= _FREQUENT))
    if np.count_nonzero(compared) < _FEWEST_CODES or np.count_nonzero(absent) < _FEWEST_ABSENT:
        return None
    best = _likeliest(_EXPONENTS, absent, compared)
    best = _likeliest(best * (1 + _STEP * _FINE), absent, compared)
    omitted = _omitted(np.array([best]))[0] & compared
    both, either = np.count_nonzero(omitted & absent), np.count_nonzero(omitted | absent)
    if both < _LEAST_AGREEMENT * either:
        return None
    n, m, k = (int(np.count_nonzero(mask)) for mask in (compared, omitted, absent))
    # Hypergeometric: of the C(n, k) sets of k absent codes, those which share h codes or more with the m omitted ones.
    agreeing = sum(comb(m, h) * comb(n - m, k - h) for h in range(int(both), min(m, k) + 1))
    chance = agreeing / comb(n, k) * (len(_EXPONENTS) * len(_FINE))
    return best if chance < _CHANCE else None


def _likeliest(exponents: Float64, absent: Bools, compared: Bools) -> float:
    """Return the exponent (of n) whose omitted codes differ least from the absent ones, the middle of several."""
    differing = np.count_nonzero((_omitted(exponents) != absent) & compared, axis=1)
    least = np.flatnonzero(differing == differing.min())
    return float(exponents[least[len(least) // 2]])


def _omitted(exponents: Float64) -> Bools:
    """Return which codes (n, 256) no code reaches under each of the exponents (n,)."""
    reached = np.rint(WHITE_DN * (np.arange(CODES) / WHITE_DN) ** exponents[:, np.newaxis]).astype(np.intp)
    omitted = np.ones((len(exponents), CODES), dtype=np.bool_)
    omitted[np.arange(len(exponents))[:, np.newaxis], reached] = False
    return omitted
