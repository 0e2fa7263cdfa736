"""Depth against colour: position in the image."""

from collections.abc import Sequence
from typing import Final

from fedora_qa.checks.alignment.edge_shifts import EventEdges, colour_edges, event_edges
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.depth.edge_profiles import FARTHEST_PX
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_edges import (
    VARIANTS,
    DepthEdges,
    depth_edges,
    why_depth_and_colour_do_not_meet,
)

_WHERE: Final = Where(stream="depth")


class AlignmentDepth(WindowCheck[DepthEdges]):
    """Do steps of depth lie where colour frames have edges?

    The shift of edges in colour frames against the steps of depth, in px to the right and down; and the increase of the
    agreement by mirrored frames.

    Why it matters
    --------------
    Half a pixel between renderers is an error of half a pixel at every outline: pixels on the rim of an object have the
    depth of the background, and the flow of the other side.

    How
    ---
    The profile of a step is measured at each position where depth changes to a nearer surface (by a tenth of inverse
    depth at least; ground that leaves the range of depth has no outline there). It consists of the differences of
    neighbouring pixels of log luma, along the row and along the column. The mean profile has its peak at the image
    edge. Left (upper) and right (lower) outlines of objects are averaged separately. Shifts of up to eight pixels are
    measured. For a colour camera at another position, pixels are transferred through depth, with the depth of the
    nearer surface. The same is done with mirrored frames. Events, where they exist, determine which camera is shifted.

    Noise model
    -----------
    Edges of texture are the noise. They differ between positions, and hardly over time: the standard error is the
    jackknife over tiles of the image, combined with that over segments of time. Texture differs on both sides of an
    outline, which shifts the peaks of left and right outlines apart. Half their distance is measured, and bounds the
    error of the mean if both peaks are shifted in one direction. If the peaks are skewed, the mean changes when peaks
    are taken a pixel wider; this change is measured too. The sum of both is the model error bound
    (``fedora_qa/estimators/depth/edge_profiles.py``). It is larger where an edge beside the outlines is stronger on one
    side.

    Cannot detect
    -------------
    A shift along all edges of a scene. A smooth distortion. A shift smaller than the bound by texture. Scenes without
    steps of depth, or whose outlines are no stronger than the texture; these are reported as not_observable.

    Sources
    -------
    I. J. Schoenberg, Quarterly of Applied Mathematics 4 (1946) 45 (an edge of box-filtered pixels is a quadratic
    B-spline, whose centroid is exact: ``fedora_qa/estimators/depth/edge_profiles.py``); B. Efron, C. Stein, Annals of
    Statistics 9 (1981).
    """

    name = "alignment.depth"
    needs = ("depth", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras, as pinholes whose optical axes have about one direction."""
        return why_depth_and_colour_do_not_meet(facts)

    def measure(self, window: Window) -> DepthEdges | None:
        """Add up the edge profiles of some frames."""
        return depth_edges(window)

    def conclude(self, state: Sequence[DepthEdges], facts: Facts) -> Observation:
        """Find the peaks of the summed profiles."""
        coverage = Coverage(sum(edges.frames for edges in state), len(facts.clocks["depth"].times_ns), "depth frames")
        if not state:
            return Observation(coverage, unobservable="no depth frame has the timestamp of a colour frame")
        # VARIANTS begins with the frames as stored; the others are mirrored.
        stored, *mirrored_variants = colour_edges(state)
        best = max(range(len(mirrored_variants)), key=lambda i: mirrored_variants[i].peak_fraction)
        mirrored = mirrored_variants[best]
        # A peak of either suffices: a mirrored camera has its peak in a mirrored variant only.
        if not stored.significant and not mirrored.significant:
            why = (
                f"edges of colour frames are not concentrated at steps of depth within {FARTHEST_PX} px: "
                f"a share of {stored.peak_fraction:.2g} +/- {stored.peak_fraction_error:.1g}"
            )
            return Observation(coverage, unobservable=why)
        events = event_edges(state)
        orientation = Statistic(
            name="advantage_of_mirrored_frames",
            value=mirrored.peak_fraction - stored.peak_fraction,
            unit="1",
            standard_error=(stored.peak_fraction_error**2 + mirrored.peak_fraction_error**2) ** 0.5,
            side="upper",
            blind_from=max(stored.peak_fraction, mirrored.peak_fraction),
            # The better of the mirrored variants was chosen.
            tests=len(VARIANTS) - 1,
            statement=f"At steps of depth lie {mirrored.peak_fraction:.2g} of the edges around them in colour frames "
            f"{VARIANTS[best + 1]}, and {stored.peak_fraction:.2g} in frames as stored.",
            code="alignment.depth.mirrored",
            where=_WHERE,
            features=(EventEdges(events.significant),),
        )
        # Frames that fit better mirrored have no shift as stored.
        if mirrored.peak_fraction > stored.peak_fraction:
            return Observation(coverage, (orientation,))
        # Depth is the reference of both pairs: a shifted depth camera appears in both, a shifted colour or event camera
        # in its own pair only.
        pairs = (stored.against_depth("rgb"), events.against_depth("events"))
        shifts = [
            Statistic(
                name=f"shift_{direction}",
                value=shift.shift_px,
                unit="px",
                standard_error=shift.standard_error_px,
                model_error_bound=shift.model_error_bound_px,
                statement=f"Edges of colour frames lie {shift.shift_px:+.3g} +/- {shift.standard_error_px:.2g} px "
                f"({direction} positive) from the steps of depth.",
                code="alignment.depth.shift",
                where=_WHERE,
                features=tuple(pair for pair in pairs if pair is not None),
            )
            for direction, shift in (("right", stored.right), ("down", stored.down))
            if shift is not None
        ]
        return Observation(coverage, (*shifts, orientation))
