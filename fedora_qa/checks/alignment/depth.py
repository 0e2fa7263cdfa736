"""Depth against colour: place in the image."""

from collections.abc import Sequence
from typing import Final

from fedora_qa.checks.alignment.edge_shifts import Edges, colour_edges, event_edges
from fedora_qa.checks.alignment.odd_one_out import shift_suspects
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.depth.edge_profiles import FARTHEST_PX
from fedora_qa.estimators.depth.edge_shift import EdgeShift
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
    jackknife over tiles of the image, with that over stretches of time. Texture is not alike on both sides of an
    outline, which draws left and right outlines apart: half their distance is measured, and bounds the error of the
    mean where both sides lean alike. Where they lean the same way in the image, peaks are skewed: by how much the mean
    moves when peaks are taken a pixel wider is measured too. Both together are the allowance
    (``fedora_qa/estimators/depth/edge_shift.py``), which grows where a line beside the outlines outshines them on one
    side.

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
    _MATTERS_PX: Final = 2.0

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras, as pinholes that look in about one direction."""
        return why_depth_and_colour_do_not_meet(facts)

    def measure(self, window: Window) -> DepthEdges | None:
        """Sum the edge profiles of some frames."""
        return depth_edges(window)

    def conclude(self, state: Sequence[DepthEdges], facts: Facts) -> Observation:
        """Find the peaks."""
        coverage = Coverage(sum(one.frames for one in state), len(facts.clocks["depth"].times_ns), "depth frames")
        if not state:
            return Observation(coverage, unobservable="no depth frame has the stamp of a colour frame")
        stored, *mirrored = colour_edges(state)
        best = max(range(len(mirrored)), key=lambda i: mirrored[i].share)
        if not stored.certain and not mirrored[best].certain:
            return Observation(coverage, unobservable=_why_none(stored))
        events = event_edges(state)
        orientation = self._orientation(stored, mirrored[best], VARIANTS[best + 1], events, facts)
        if mirrored[best].share > stored.share:
            return Observation(coverage, (orientation,))
        pairs = [pair for pair in (stored.pair("rgb"), events.pair("events")) if pair is not None]
        suspects = (*shift_suspects(pairs, facts.declared.cameras), *_OTHERS)
        axes = (("shift_right", stored.right, "right"), ("shift_down", stored.down, "down"))
        shifts = [self._shift(name, one, word, suspects) for name, one, word in axes if one is not None]
        return Observation(coverage, (*shifts, orientation))

    def _shift(self, name: str, found: EdgeShift, word: str, suspects: tuple[Suspect, ...]) -> Statistic:
        return Statistic(
            name=name,
            value=found.shift_px,
            unit="px",
            standard_error=found.standard_error_px,
            model_error_bound=found.model_error_bound_px,
            material=self._MATTERS_PX,
            statement=f"Edges of colour frames lie {found.shift_px:+.3g} +/- {found.standard_error_px:.2g} px "
            f"({word} positive) from the steps of depth.",
            code="alignment.depth.shift",
            where=_WHERE,
            suspects=suspects,
        )

    def _orientation(self, stored: Edges, mirrored: Edges, how: str, events: Edges, facts: Facts) -> Statistic:
        error = (stored.share_error**2 + mirrored.share_error**2) ** 0.5
        return Statistic(
            name="advantage_of_mirrored_frames",
            value=mirrored.share - stored.share,
            unit="1",
            standard_error=error,
            side="upper",
            material=max(stored.share, mirrored.share),
            tests=len(VARIANTS) - 1,
            statement=f"Steps of depth hold {mirrored.share:.2g} of the edges around them in colour frames {how}, "
            f"{stored.share:.2g} in frames as stored.",
            code="alignment.depth.mirrored",
            where=_WHERE,
            suspects=_mirrored_suspects(events, facts),
        )


_OTHERS: Final = (
    Suspect("time_offset", "rgb", 0.3),
    Suspect("time_offset", "depth", 0.3),
    Suspect("swapped_frames", "rgb", 0.1),
    Suspect("swapped_frames", "depth", 0.1),
)
"""What moves edges with the motion of the image."""


def _mirrored_suspects(events: Edges, facts: Facts) -> tuple[Suspect, ...]:
    """Events that lie at the steps of depth say that depth is right; events that do not, that it is wrong."""
    by_events = "events" in facts.streams and "events" in facts.declared.cameras
    depth, rgb = (0.7, 0.7) if not by_events else (0.3, 0.9) if events.certain else (0.9, 0.5)
    return Suspect("mirrored", "depth", depth), Suspect("mirrored", "rgb", rgb)


def _why_none(stored: Edges) -> str:
    return (
        f"edges of colour frames do not stand out at steps of depth within {FARTHEST_PX} px: "
        f"a share of {stored.share:.2g} +/- {stored.share_error:.1g}"
    )
