"""Train one network: Adam, a cosine from the first step to the last, early stopping by the validation flights."""

import copy
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor

from tests.benchmarks.learning.budget import BATCH, Budget
from tests.benchmarks.learning.mirroring import MIRRORED_FLOW, MIRRORED_MOTION
from tests.benchmarks.learning.network import MotionNetwork, TargetScales, loss_of
from tests.benchmarks.learning.samples import Samples

LEARNING_RATE: Final = 3e-3
LARGEST_GRADIENT: Final = 1.0
MIRRORED_SHARE: Final = 0.5
"""Of the samples, left to right."""

Batch = tuple[Tensor, Tensor, Tensor, Tensor]


@dataclass(frozen=True, slots=True)
class Trained:
    """A network at the step with the least validation loss, and the steps that were taken altogether."""

    network: MotionNetwork
    steps: int
    best_step: int
    validation_loss: float


def train(samples: Samples, validation: Samples, budget: Budget, seed: int, device: str) -> Trained:
    """Train a network; the same seed gives the same network on the same machine and number of threads."""
    torch.manual_seed(seed)
    generator = torch.Generator().manual_seed(seed)
    scales = scales_of(samples)
    nonzero = samples.voxels[samples.voxels != 0]
    voxel_scale = float(np.sqrt(np.mean(nonzero**2))) if nonzero.size else 1.0
    mean_motion = torch.from_numpy(samples.targets.motion.mean(axis=0))
    # Channels last: a step takes two thirds of the time on a CPU.
    network = MotionNetwork(scales, voxel_scale, mean_motion).to(device, memory_format=torch.channels_last)
    data, held_out = _tensors(samples, device), _tensors(validation, device)
    optimiser = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE, fused=True)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda step: 0.5 * (1 + math.cos(math.pi * min(step / budget.steps, 1.0)))
    )
    # All draws and signs are moved before the first step, so that no step of a GPU waits for them.
    chosen = torch.randint(len(samples), (budget.steps, BATCH), generator=generator).to(device)
    mirror = (torch.rand((budget.steps, BATCH), generator=generator) < MIRRORED_SHARE).to(device)
    signs = torch.from_numpy(MIRRORED_FLOW).to(device), torch.from_numpy(MIRRORED_MOTION).to(device)
    best_loss, best_step, best_state = math.inf, 0, copy.deepcopy(network.state_dict())
    step = 0
    while step < budget.steps:
        network.train()
        batch = _mirrored(tuple(values[chosen[step]] for values in data), mirror[step], signs)
        optimiser.zero_grad()
        loss = loss_of(network(batch[0]), batch[1:], scales)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
        optimiser.step()
        schedule.step()
        step += 1
        if step % budget.evaluate_every == 0 or step == budget.steps:
            validation_loss = _loss(network, held_out, scales)
            if validation_loss < best_loss:
                best_loss, best_step, best_state = validation_loss, step, copy.deepcopy(network.state_dict())
            elif step - best_step >= budget.patience * budget.evaluate_every:
                break
    network.load_state_dict(best_state)
    return Trained(network, step, best_step, best_loss)


def scales_of(samples: Samples) -> TargetScales:
    """Return the mean sizes of the targets."""
    targets = samples.targets
    return TargetScales(
        flow_px=float(np.nanmean(np.linalg.norm(targets.flow_px, axis=1))),
        disparity_per_m=float(np.nanmean(targets.disparity_per_m)),
        translation_m=float(np.linalg.norm(targets.motion[:, :3], axis=1).mean()),
        rotation_rad=float(np.linalg.norm(targets.motion[:, 3:], axis=1).mean()),
    )


def _tensors(samples: Samples, device: str) -> Batch:
    targets = samples.targets
    arrays = (samples.voxels, targets.flow_px, targets.disparity_per_m, targets.motion)
    voxels, flow, disparity, motion = (torch.from_numpy(values).to(device) for values in arrays)
    return voxels.contiguous(memory_format=torch.channels_last), flow, disparity, motion


def _mirrored(batch: tuple[Tensor, ...], mirror: Tensor, signs: tuple[Tensor, Tensor]) -> Batch:
    """Mirror the samples of a batch where ``mirror`` (n,) is true; ``signs`` are those of flow (2,) and motion (6,)."""
    voxels, flow, disparity, motion = batch
    flow_signs, motion_signs = signs
    images = mirror[:, None, None, None]
    return (
        torch.where(images, voxels.flip(-1), voxels),
        torch.where(images, flow.flip(-1) * flow_signs[:, None, None], flow),
        torch.where(mirror[:, None, None], disparity.flip(-1), disparity),
        torch.where(mirror[:, None], motion * motion_signs, motion),
    )


def _loss(network: MotionNetwork, data: Batch, scales: TargetScales) -> float:
    network.eval()
    with torch.no_grad():
        outputs = [network(part) for part in data[0].split(64)]
        flow, disparity, motion = (torch.cat(values) for values in zip(*outputs, strict=True))
        return float(loss_of((flow, disparity, motion), data[1:], scales))
