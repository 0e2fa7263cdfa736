"""Shift between two pictures of one thing: their cross-correlation against an autocorrelation.

If the second picture is the first one moved by d, plus an unrelated part, the cross-correlation is the autocorrelation
of the first moved by d. Correlations, unlike pictures, can be summed over frames, so that the shift is estimated once
from all of them. The two are registered by a discrete Fourier transform that is upsampled around its peak (M.
Guizar-Sicairos, S. T. Thurman, J. R. Fienup, Opt. Lett. 33 (2008)), with scikit-image. Both are tapered, which biases
the result towards zero. Therefore the reference is moved until no shift is left.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift as moved_by
from skimage.registration import phase_cross_correlation

from fedora_qa.estimators.events.shift import Shift

Float64 = NDArray[np.float64]

UPSAMPLING: Final = 200
"""Shifts are resolved to 1/200 px, a tenth of the error of those estimated from the frames of one second."""

PEAK_RADIUS_PX: Final = 4
"""Radius of the part around a peak that is registered: beyond it the correlation depends on texture, not on the
shift."""

_ROUNDS: Final = 8
"""Each round leaves at most half of the residual shift."""


def registered_shift(autocorrelation: Float64, crosscorrelation: Float64) -> Shift | None:
    """Return the shift of the second correlation against the first.

    Parameters
    ----------
    autocorrelation, crosscorrelation
        (2 R + 1, 2 R + 1), zero shift in the middle, one element for each px. Shifts of up to R -
        ``PEAK_RADIUS_PX`` px are found.

    Returns
    -------
    Shift or None
        To the right and down, px; None where the cross-correlation has no positive peak within that range.
    """
    radius = autocorrelation.shape[0] // 2
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(crosscorrelation)), crosscorrelation.shape))
    whole = np.array([row - radius, column - radius])
    if crosscorrelation[row, column] <= 0 or np.abs(whole).max() > radius - PEAK_RADIUS_PX:
        return None
    moved = _tapered(crosscorrelation, row, column)
    # The taper biases the estimate towards zero: the reference is moved until no shift remains.
    fraction = np.zeros(2)
    for _ in range(_ROUNDS):
        reference = _tapered(moved_by(autocorrelation, fraction, order=3), radius, radius)
        # Guizar-Sicairos et al. 2008: upsampled DFT around the peak; correlations are registered as they are.
        registered, *_ = phase_cross_correlation(  # type: ignore[no-untyped-call]  # scikit-image publishes none
            reference, moved, upsample_factor=UPSAMPLING, normalization=None
        )
        back = np.asarray(registered, dtype=np.float64)
        # The largest sample lies within a pixel of its peak: a larger shift would be that of another peak.
        fraction = np.clip(fraction - back, -1.0, 1.0)
        if np.abs(back).max() <= 1 / UPSAMPLING:
            break
    down, right = whole + fraction
    return Shift(float(right), float(down))


def _tapered(patch: Float64, row: int, column: int) -> Float64:
    reach = PEAK_RADIUS_PX
    cut = patch[row - reach : row + reach + 1, column - reach : column + reach + 1]
    taper = np.hanning(2 * reach + 3)[1:-1]
    tapered: Float64 = (cut - cut.min()) * np.outer(taper, taper)
    return tapered
