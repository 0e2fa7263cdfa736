"""Vignetting: fall-off of the brightness towards the corners, by frames along the flow."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.images.vignetting import PairEquations, fit_vignetting, pair_equations
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.cell_brightness import cell_ratios
from fedora_qa.views.flow_intervals import owned_intervals
from fedora_qa.views.frame_pairs import flow_rate_of
from fedora_qa.views.warped_frames import frame_pair, optics_of

_PERCENT: Final = 100.0


@dataclass(frozen=True, slots=True)
class WindowVignetting:
    """Frame pairs of a window.

    Attributes
    ----------
    pairs
        Normal equations of the pairs with enough cells, in the order of time.
    intervals
        Number of fields with a colour frame at both ends.
    """

    pairs: tuple[PairEquations, ...]
    intervals: int


@dataclass(frozen=True, slots=True)
class CornerLoss(Feature):
    """Loss of brightness towards the corners.

    Attributes
    ----------
    percent
        Loss in the farthest corner; negative where the corner is brighter than the centre.
    standard_error_percent
        Of the loss.
    """

    percent: float
    standard_error_percent: float


class ImagesVignetting(WindowCheck[WindowVignetting]):
    """Do frames get darker towards the corners?

    The loss of brightness in the corner that is farthest from the principal point, in percent of the brightness at the
    principal point, in linear light. It is negative where corners are too bright.

    Why it matters
    --------------
    Events, depth and flow of a simulator contain no vignetting. If only the frames have it, a surface gets darker as it
    moves outwards, and no events correspond to the change. Photometric losses and learned features then depend on the
    position in the image.

    How
    ---
    The flow of the slowest rate maps each frame to a later one. Cells of 8 x 8 pixels that both frames show, away from
    edges of the depth and from clipped pixels, have the same radiance in both. The logarithm of the ratio of their
    brightness is proportional to the change of their squared distance from the principal point. Huber's regression over
    the cells of a pair of frames gives the slope, with one constant of the pair for its exposure. All pairs together
    give the loss (``fedora_qa/estimators/images/vignetting.py``). A pair uses 48 tiles of 32 x 32 pixels, a new sample
    for each field; more tiles if the effort requires a larger share. Distances are tangents of angles, so that cropped
    frames, whose principal point is not their middle, are measured about the optical axis.

    Noise model
    -----------
    The scatter of the cells about the fit of their pair contains noise, rounding, detail that the pixels do not
    resolve, and errors of the flow. The standard error is the largest of three: that of independent cells, and those
    from the scatter of whole pairs and of 24 parts of the image, whose cells may share errors. The model error bound is
    half of the variance of a cell's logarithm times its mean change of position: the logarithm of a noisy sum is too
    small by at most that. Frames that were rounded and then darkened keep every code that changes by less than half a
    step. The detection limit therefore includes the loss that darkens the compared surfaces by 1 DN on average.

    Cannot detect
    -------------
    A fall-off that the events and all other streams share. Light that moves with the camera, which has the same effect
    and is reported as vignetting. A fall-off that is not symmetric about the principal point. One that is not quadratic
    in the tangent of the angle is measured with an error of some hundredths of itself. Colour: only luma is compared. A
    loss after rounding that darkens surfaces by less than 1 DN is missed, or measured too small by up to two thirds;
    one of 1 to 2 DN by up to two fifths, where colours are uniform. Motion that changes no distance from the principal
    point, as in hovering flight: the detection limit is stated. Frames so dark or so clipped that few cells remain.
    Specular surfaces have another brightness in each direction: they increase the error. The fall-off of a lamp that is
    fixed in the world belongs to the surfaces.

    Sources
    -------
    D. B. Goldman, Vignette and exposure calibration and compensation, IEEE Trans. Pattern Anal. Mach. Intell. 32 (2010)
    2276: brightness of the same points in several frames determines vignetting and exposure together. The derivation is
    in ``fedora_qa/estimators/images/vignetting.py``.
    """

    name = "images.vignetting"
    needs = ("rgb", "flow")

    def not_applicable(self, facts: Facts) -> str:
        """Return why frames cannot be mapped onto the flow's grid, or have no optical axis; empty where they can."""
        if "rgb" not in facts.declared.cameras:
            return "the camera rgb is not declared in /metadata/cameras, so that the principal point is not known"
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> WindowVignetting | None:
        """Compare the frames at both ends of each field of the slowest rate that the window owns."""
        facts = window.facts
        optics, stream = optics_of(facts), slowest_between_frames(facts)
        if isinstance(optics, str) or stream is None or flow_rate_of(window) is None:
            return None
        camera, pairs, intervals = facts.declared.cameras["rgb"], [], 0
        for interval in owned_intervals(window, stream):
            frames = frame_pair(window, optics, interval)
            if frames is None:
                continue
            intervals += 1
            cells = cell_ratios(frames, interval, camera, window.sampling.tile_share)
            equations = None if cells is None else pair_equations(cells)
            pairs += [equations] if equations else []
        return WindowVignetting(tuple(pairs), intervals)

    def conclude(self, state: Sequence[WindowVignetting], facts: Facts) -> Observation:
        """Return the loss that fits all pairs of frames."""
        pairs = [pair for w in state for pair in w.pairs]
        coverage = Coverage(len(pairs), sum(w.intervals for w in state), "frame pairs")
        fit = fit_vignetting(pairs)
        if fit is None:
            why = "no two frames at the ends of a flow field share enough surfaces that are neither dark nor clipped"
            return Observation(coverage, unobservable=why)
        loss = fit.loss_percent
        # d loss / d a = exp(-|a|), which is 1 for a correct file. The limit is that of a correct file.
        error = _PERCENT * fit.standard_error
        feature = CornerLoss(loss, exp(-abs(fit.a)) * error)
        change = "darker" if loss > 0 else "brighter"
        return Observation(
            coverage,
            (
                Statistic(
                    name="corner_loss",
                    value=loss,
                    unit="percent",
                    standard_error=error,
                    model_error_bound=_PERCENT * fit.model_error_bound,
                    resolution=_PERCENT * fit.step,
                    statement=f"The frames get {change} from the principal point to the farthest corner, by "
                    f"{abs(loss):.3g} +/- {feature.standard_error_percent:.2g}%, at the same surfaces.",
                    code="images.vignetting.corner",
                    where=Where(stream="rgb"),
                    features=(feature,),
                ),
            ),
        )


def slowest_between_frames(facts: Facts) -> str | None:
    """Return the slowest flow stream with a field that has a colour frame at both ends; None where there is none.

    Parameters
    ----------
    facts
        With the clocks of the colour frames and of the flow.

    Returns
    -------
    str or None
        ``flow/<rate>hz``.
    """
    frames_ns = facts.clocks["rgb"].times_ns
    for stream in facts.flow_streams:
        clock = facts.clocks[stream]
        if clock.ends_ns is not None and np.any(np.isin(clock.times_ns, frames_ns) & np.isin(clock.ends_ns, frames_ns)):
            return stream
    return None
