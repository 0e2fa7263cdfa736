"""One small encoder with three decoders: flow, disparity and motion from a voxel grid of events."""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn
from torch.nn import functional

from tests.benchmarks.learning.budget import BINS, EVENT_SIZE
from tests.benchmarks.learning.samples import MOTION_COLUMNS, Targets

CHANNELS: Final = (12, 24, 48)
"""Of the encoder, whose levels have a half, a quarter and an eighth of the size."""
_MOTION_CHANNELS: Final = 8
_HIDDEN: Final = 64
_SLOPE: Final = 0.1
"""Of rectifiers below 0."""
_ONE_BY_SOFTPLUS: Final = 0.5413
"""softplus(0.5413) = 1: an untrained decoder predicts the mean disparity."""


@dataclass(frozen=True, slots=True)
class TargetScales:
    """Mean sizes of the training set, by which outputs and losses are scaled: |flow|, disparity, |t|, |r|."""

    flow_px: float
    disparity_per_m: float
    translation_m: float
    rotation_rad: float


class MotionNetwork(nn.Module):
    """Voxel grids (n, bins, H, W) to flow (n, 2, H, W), disparity (n, H, W) and motion (n, 6)."""

    def __init__(self, scales: TargetScales, voxel_scale: float, mean_motion: Tensor) -> None:
        super().__init__()
        first, second, third = CHANNELS
        self.scales = scales
        self.voxel_scale = voxel_scale
        self.register_buffer("mean_motion", mean_motion)
        self.register_buffer(
            "motion_scale", torch.tensor([scales.translation_m] * 3 + [scales.rotation_rad] * 3, dtype=torch.float32)
        )
        self.halves = _convolution(BINS, first, stride=2)
        self.quarters = _convolution(first, second, stride=2)
        self.eighths = nn.Sequential(_convolution(second, third, stride=2), _convolution(third, third))
        self.flow = _ImageDecoder(2)
        self.disparity = _ImageDecoder(1)
        width, height = EVENT_SIZE
        self.motion = nn.Sequential(
            _convolution(third, _MOTION_CHANNELS),
            nn.Flatten(),
            nn.Linear(_MOTION_CHANNELS * (width // 8) * (height // 8), _HIDDEN),
            nn.LeakyReLU(_SLOPE),
            nn.Linear(_HIDDEN, MOTION_COLUMNS),
        )

    def forward(self, voxels: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return flow in px, disparity in 1/m, and motion in m and rad."""
        halves = self.halves(voxels / self.voxel_scale)
        quarters = self.quarters(halves)
        eighths = self.eighths(quarters)
        flow_px = self.flow(halves, quarters, eighths) * self.scales.flow_px
        disparity = functional.softplus(self.disparity(halves, quarters, eighths)[:, 0] + _ONE_BY_SOFTPLUS)
        motion = self.mean_motion + self.motion(eighths) * self.motion_scale
        return flow_px, disparity * self.scales.disparity_per_m, motion


def loss_of(
    outputs: tuple[Tensor, Tensor, Tensor], truth: tuple[Tensor, Tensor, Tensor], scales: TargetScales
) -> Tensor:
    """Return NAEE + NADE + the mean of both NAE of the motion: what is scored, over the valid pixels of a batch."""
    (flow_px, disparity, motion), (true_flow_px, true_disparity, true_motion) = outputs, truth
    # A norm has no gradient at 0.
    squares = ((flow_px - torch.nan_to_num(true_flow_px)) ** 2).sum(dim=1)
    flow_valid = torch.isfinite(true_flow_px).all(dim=1)
    naee = _mean_where(flow_valid, torch.sqrt(squares + 1e-8)) / scales.flow_px
    disparity_errors = (disparity - torch.nan_to_num(true_disparity)).abs()
    nade = _mean_where(torch.isfinite(true_disparity), disparity_errors) / scales.disparity_per_m
    errors = motion - true_motion
    nae = 0.5 * (
        torch.sqrt((errors[:, :3] ** 2).sum(dim=1) + 1e-12).mean() / scales.translation_m
        + torch.sqrt((errors[:, 3:] ** 2).sum(dim=1) + 1e-12).mean() / scales.rotation_rad
    )
    return naee + nade + nae


def _mean_where(valid: Tensor, values: Tensor) -> Tensor:
    """Return the mean of the valid values. Selecting them by index would make a GPU wait for their number."""
    return torch.where(valid, values, 0.0).sum() / valid.sum()


def predict(network: MotionNetwork, voxels: Tensor, batch: int = 64) -> Targets:
    """Return what a network predicts, as arrays."""
    network.eval()
    with torch.no_grad():
        parts = [network(part) for part in voxels.split(batch)]
    return Targets(*(torch.cat(outputs).cpu().numpy() for outputs in zip(*parts, strict=True)))


class _ImageDecoder(nn.Module):
    """From the levels of the encoder to an image of ``outputs`` channels at the size of the input."""

    def __init__(self, outputs: int) -> None:
        super().__init__()
        first, second, third = CHANNELS
        self.quarters = _convolution(third + second, second)
        self.halves = _convolution(second + first, first)
        self.output = nn.Conv2d(first, outputs, 3, padding=1)

    def forward(self, halves: Tensor, quarters: Tensor, eighths: Tensor) -> Tensor:
        features = self.quarters(torch.cat([_doubled(eighths), quarters], dim=1))
        features = self.halves(torch.cat([_doubled(features), halves], dim=1))
        return _doubled(self.output(features))


def _convolution(inputs: int, outputs: int, stride: int = 1) -> nn.Module:
    convolution = nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1)
    # He et al., ICCV 2015: signals keep their size from layer to layer. By PyTorch's default they shrink by 2.4.
    nn.init.kaiming_normal_(convolution.weight, a=_SLOPE, nonlinearity="leaky_relu")
    nn.init.zeros_(convolution.bias)
    return nn.Sequential(convolution, nn.LeakyReLU(_SLOPE))


def _doubled(image: Tensor) -> Tensor:
    return functional.interpolate(image, scale_factor=2, mode="bilinear", align_corners=False)


def parameter_count() -> int:
    """Return the number of trained parameters."""
    network = MotionNetwork(TargetScales(1.0, 1.0, 1.0, 1.0), 1.0, torch.zeros(MOTION_COLUMNS))
    return sum(parameter.numel() for parameter in network.parameters())
