"""Depth against colour: place in the image."""

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

    The shift of edges in colour frames against the steps of depth, in px to the right and down; and how much better
    mirrored frames would fit.

    Why it matters
    --------------
    Half a pixel between renderers is half a pixel at every outline: depth of the background on the rim of each thing,
    and flow that belongs to the other side.

    How
    ---
    Around each place where depth steps from one surface to a nearer one (by a tenth of inverse depth at least; ground
    that runs out of the range of depth has no outline there), the differences of neighbouring pixels of log luma are
    read along the row, and along the column. Their mean profile peaks where the image has its edge: to the right and
    down, for things whose left (upper) and right (lower) outlines are seen, each side by itself. Shifts of up to eight
    pixels are found. A colour camera that sits elsewhere is looked at through depth, with the depth of the nearer
    surface. The same is tried with mirrored frames. Events, where they are, tell which camera is off.

    Noise model
    -----------
    Edges of texture are the noise. They differ from place to place, and hardly over time, so the standard error is the
    jackknife over tiles of the image, with that over segments of time. Texture is not alike on both sides of an
    outline, which draws left and right outlines apart: half their distance is measured, and bounds the error of the
    mean where both sides lean alike. Where they lean the same way in the image, peaks are skewed: by how much the mean
    moves when peaks are taken a pixel wider is measured too. Both together are the allowance
    (``fedora_qa/estimators/depth/edge_profiles.py``), which grows where a line beside the outlines outshines them on
    one side.

    Cannot see
    ----------
    A shift along all edges of a scene, a smooth distortion, a shift of less than the texture's lean. Scenes without
    steps of depth, or whose outlines do not stand out from the texture, where it says so.

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
        """Sum the edge profiles of some frames."""
        return depth_edges(window)

    def conclude(self, state: Sequence[DepthEdges], facts: Facts) -> Observation:
        """Find the peaks of the summed profiles."""
        coverage = Coverage(sum(edges.frames for edges in state), len(facts.clocks["depth"].times_ns), "depth frames")
        if not state:
            return Observation(coverage, unobservable="no depth frame has the stamp of a colour frame")
        # VARIANTS begins with the frames as stored; the others are mirrored.
        stored, *mirrored_variants = colour_edges(state)
        best = max(range(len(mirrored_variants)), key=lambda i: mirrored_variants[i].peak_fraction)
        mirrored = mirrored_variants[best]
        # A peak of either suffices: a mirrored camera has its peak in a mirrored variant only.
        if not stored.significant and not mirrored.significant:
            why = (
                f"edges of colour frames do not stand out at steps of depth within {FARTHEST_PX} px: "
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
            statement=f"Steps of depth hold {mirrored.peak_fraction:.2g} of the edges around them in colour frames "
            f"{VARIANTS[best + 1]}, {stored.peak_fraction:.2g} in frames as stored.",
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
