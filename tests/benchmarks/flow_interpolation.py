"""What reading frames between their pixels costs, and how far it puts flow off: docs/flow-interpolation.md.

Two frames of one texture in closed form, the second 1% larger, so that the true flow takes all fractions of a pixel.
The texture's amplitudes fall as 1/frequency up to 4 rad/px, beyond what pixels resolve; pixels are boxes, frames 8-bit.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter

from fedora_qa.estimators.flow.residual import TileGrid, patches_of, pixels_of, tile_residuals
from fedora_qa.estimators.flow.warp import read_at_pixels, read_between, smooth
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2

Float32 = NDArray[np.float32]

WIDTH, HEIGHT, ZOOM, WAVES = 720, 540, 1.01, 400
_RUNS: Final = 5
PAGE: Final = Path("docs/flow-interpolation.md")

HEAD: Final = """\
# Interpolation of frames between pixels

`flow_photometric.residual` warps a frame back by the flow. The interpolation between pixels causes an error of the
residual even where the flow is correct, and so limits what the check can detect. `make bench-flow` measures this
error. The frames have 720x540 pixels and 8 bits, and show a texture in closed form whose amplitudes fall as
1/frequency. All tiles of 32 px are compared, with a true flow of up to 3.6 px. *Median* and *95%* are quantiles of
the residual flow of the tiles. *Locking* is the amplitude of the bias that follows sin(2 pi flow). *Read* is the time
to smooth and interpolate both frames once with one thread.

| kernel | sigma, px | median, px | 95%, px | locking, px | read, ms |
| --- | --- | --- | --- | --- | --- |
"""

TAIL: Final = """
The spline kernel is a Gaussian and a cubic B-spline without prefilter. Sigma is the width of both together. Its
result is the exact value of the image after this smoothing. Its error is six times smaller than that of bilinear
interpolation. On sampled tiles it costs some ten nanoseconds a pixel, which is little in comparison with the mask and
the fit. So all efforts use it, with sigma 1. A narrower kernel gains resolution, but loses it again to aliases of
texture that the pixels do not resolve. The cubic of OpenCV is a different kernel and has the largest error. OpenCV's
Lanczos rounds positions to 1/32 px, and version 4 does so with every kernel. Tests verify this for the installed
version.
"""


@dataclass(frozen=True, slots=True)
class Interpolator:
    """A method of reading frames between their pixels.

    Attributes
    ----------
    smoothed
        From an image (H, W) and a standard deviation in px to the image that is read.
    at_pixels
        From that image to the values (H, W) of ``between`` at all pixel centres.
    between
        From that image and finite positions (n, m), columns and rows, px, to the values there.
    """

    smoothed: Callable[[Float32, float], Float32]
    at_pixels: Callable[[Float32], Float32]
    between: Callable[[Float32, Float32, Float32], Float32]


def _blur(image: Float32, sigma_px: float) -> Float32:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REFLECT_101), dtype=np.float32)


def _bilinear(image: Float32, columns: Float32, rows: Float32) -> Float32:
    read = cv2.remap(image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


def _prefiltered(image: Float32, sigma_px: float) -> Float32:
    return np.asarray(spline_filter(_blur(image, sigma_px), order=3, mode="mirror"), dtype=np.float32)


def _spline_at(coefficients: Float32, columns: Float32, rows: Float32) -> Float32:
    read = map_coordinates(coefficients, [rows, columns], order=3, prefilter=False, mode="mirror")
    return np.asarray(read, dtype=np.float32)


def _spline_at_pixels(coefficients: Float32) -> Float32:
    rows, columns = np.mgrid[: coefficients.shape[0], : coefficients.shape[1]].astype(np.float32)
    return _spline_at(coefficients, columns, rows)


def _cubic(image: Float32, columns: Float32, rows: Float32) -> Float32:
    read = cv2.remap(image, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101)
    return np.asarray(read, dtype=np.float32)


_BILINEAR: Final = Interpolator(_blur, lambda blurred: blurred, _bilinear)
_SPLINE: Final = Interpolator(smooth, read_at_pixels, read_between)

KERNELS: Final = (
    ("bilinear", 1.0, _BILINEAR),
    ("bilinear", 0.7, _BILINEAR),
    ("spline", 1.0, _SPLINE),
    ("spline", 0.7, _SPLINE),
    ("prefiltered spline", 0.7, Interpolator(_prefiltered, _spline_at_pixels, _spline_at)),
    ("cubic of OpenCV", 1.0, Interpolator(_blur, lambda blurred: blurred, _cubic)),
)


def frames(seed: int = 1) -> tuple[Float32, Float32]:
    """Return the frame before and the frame after, (H, W), in whole DN."""
    rng = np.random.default_rng(seed)
    frequency, angle = np.exp(rng.uniform(np.log(0.02), np.log(4.0), WAVES)), rng.uniform(0, np.pi, WAVES)
    across, down, phase = frequency * np.cos(angle), frequency * np.sin(angle), rng.uniform(0, 2 * np.pi, WAVES)
    box = np.sinc(across / (2 * np.pi)) * np.sinc(down / (2 * np.pi))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    grey = [np.full((HEIGHT, WIDTH), 128.0) for _ in range(2)]
    for i in range(WAVES):
        for j, zoom in enumerate((1.0, ZOOM)):
            x, y = (columns - WIDTH / 2) / zoom, (rows - HEIGHT / 2) / zoom
            grey[j] += 3.0 * box[i] * np.cos(across[i] * x + down[i] * y + phase[i])
    first, second = (np.rint(np.clip(frame, 0, 255)).astype(np.float32) for frame in grey)
    return first, second


def measured(
    kernel: Interpolator, sigma_px: float, before: Float32, after: Float32
) -> tuple[float, float, float, float]:
    """Return median and 95% of the residual flow in px, the locking's amplitude in px, and seconds."""
    origins = TileGrid.of(HEIGHT, WIDTH).origins
    columns, rows = (pixels.astype(np.float32) for pixels in pixels_of(origins))
    u, v = (ZOOM - 1) * (columns - WIDTH / 2), (ZOOM - 1) * (rows - HEIGHT / 2)
    flat = (-1, columns.shape[-1])
    targets = [np.asarray((a + b).reshape(flat), dtype=np.float32) for a, b in ((columns, u), (rows, v))]
    started = time.perf_counter()
    first = kernel.at_pixels(kernel.smoothed(before, sigma_px))
    warped = kernel.between(kernel.smoothed(after, sigma_px), *targets).reshape(columns.shape)
    seconds = time.perf_counter() - started
    whole = np.ones((len(origins), 32, 32), dtype=np.bool_)
    errors_px = tile_residuals(patches_of(first, origins), warped, whole, LUMA_ROUNDING_VARIANCE_DN2).flow_errors_px
    lengths_px = np.linalg.norm(errors_px, axis=1)
    sines = np.stack([np.sin(2 * np.pi * part).mean(axis=(1, 2)) for part in (u, v)], axis=1)
    locking_px = abs(float(np.sum(sines * errors_px) / np.sum(sines**2)))
    return float(np.median(lengths_px)), float(np.percentile(lengths_px, 95)), locking_px, seconds


def page() -> Iterator[str]:
    """Write the page."""
    yield HEAD
    before, after = frames()
    for name, sigma_px, kernel in KERNELS:
        runs = [measured(kernel, sigma_px, before, after) for _ in range(_RUNS)]
        median_px, most_px, locking_px, _ = runs[0]
        seconds = min(run[3] for run in runs)
        yield f"| {name} | {sigma_px} | {median_px:.4f} | {most_px:.4f} | {locking_px:.4f} | {1000 * seconds:.0f} |\n"
    yield TAIL


if __name__ == "__main__":
    PAGE.write_text("".join(page()))
