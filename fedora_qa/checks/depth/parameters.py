"""One number about all depth, fitted to pairs of frames: the scale, and whether it is z or the length of the ray."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.depth.pair_fit import DepthFit, Family, fit_depth
from fedora_qa.estimators.depth.warp import ModelNumber
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_pairs import DepthPair, owned_pairs, place, why_no_geometry
from fedora_qa.views.flow_intervals import depths_plausible

_FAR: Final = 3.0
"""Pairs so many sigmas from the median count half."""


@dataclass(frozen=True, slots=True)
class PairFit:
    """A parameter as one pair of frames shows it.

    ``standard_error`` and ``bound`` are its errors at random and in the worst direction, ``as_declared`` and
    ``after_fit`` the typical residuals; ``as_declared`` is infinite where frames cannot be compared as declared.
    ``of_path`` is the size of the fault if the camera's path has it, NaN where it cannot.
    """

    first: int
    second: int
    value: float
    standard_error: float
    bound: float
    as_declared: float
    after_fit: float
    plausible: bool
    of_path: float


@dataclass(frozen=True, slots=True)
class Pooled:
    """All pairs together. ``explains`` is the share of the typical residual that the parameter removes."""

    value: float
    standard_error: float
    bound: float
    explains: float


class FittedParameter(WindowCheck[tuple[PairFit, ...]]):
    """What is the parameter that depth and pose agree on?

    What the checks of one parameter share: the fit of each pair, and the pooling over pairs.
    """

    needs = ("depth", "pose")
    number: ClassVar[ModelNumber]
    """Which number of the model it is."""
    from_value: ClassVar[float] = 0.0
    """Where the fit begins of frames that do not agree as declared."""
    declared_value: ClassVar[float] = 0.0
    """What the number is as declared: there the fit of frames that agree begins, with the motion that makes them."""

    def not_applicable(self, facts: Facts) -> str:
        """Say what of the model does not hold."""
        return why_no_geometry(facts)

    @abstractmethod
    def family(self, pair: DepthPair) -> Family:
        """Return what the parameter does to a pair."""

    def of_path(self, pair: DepthPair, fit: DepthFit) -> float:
        """Return the size of the fault that the camera's path would have instead; NaN where it has none."""
        return float("nan")

    def pooled(self, fits: Sequence[PairFit]) -> Pooled | None:
        """Pool the pairs."""
        return pool(fits)

    @abstractmethod
    def stated(self, pooled: Pooled, fits: Sequence[PairFit]) -> Statistic:
        """State the parameter."""

    def measure(self, window: Window) -> tuple[PairFit, ...] | None:
        """Fit every pair that the window owns."""
        fits = (self._fit(pair) for pair in owned_pairs(window) if pair is not None)
        return tuple(fit for fit in fits if fit is not None)

    def conclude(self, state: Sequence[tuple[PairFit, ...]], facts: Facts) -> Observation:
        """Pool the pairs."""
        fits = sorted((fit for fits in state for fit in fits), key=lambda fit: fit.first)
        total = max(int(np.count_nonzero(facts.clocks["depth"].advancing)) - 1, 0)
        coverage = Coverage(len(fits), total, "pairs of depth frames")
        pooled = self.pooled(fits)
        if pooled is None:
            why = "no two depth frames show the same surfaces from places that poses tell apart"
            return Observation(coverage, unobservable=why)
        measured = replace(self.stated(pooled, fits), where=place(facts, fits[0].first, fits[-1].second))
        return Observation(coverage, (measured,))

    def _fit(self, pair: DepthPair) -> PairFit | None:
        lattice, image1 = pair.lattice_to_fit(), pair.image1
        as_declared = pair.fit_as_declared()
        start, parts = self.from_value, None
        if as_declared is not None and as_declared.agrees:
            start, parts = self.declared_value, as_declared.parts
        fit = fit_depth(self.family(pair), lattice, image1, pair.noise, start=start, step=self.number, parts=parts)
        if fit is None or not np.isfinite(fit.standard_error):
            return None
        return PairFit(
            pair.first,
            pair.second,
            fit.value,
            fit.standard_error,
            fit.bound,
            as_declared.typical if as_declared else np.inf,
            fit.typical,
            depths_plausible(pair.window.facts, lattice.depths_m),
            self.of_path(pair, fit),
        )


def pool(fits: Sequence[PairFit]) -> Pooled | None:
    """Average the pairs, each weighted by how well it tells; None where there is none.

    Pairs that share a pose err against each other, so that their average errs by less than is stated. Where pairs
    spread more than they should, the spread is the standard error; pairs far from the others weigh less (Cauchy's
    weights), so that single bad frames do not lead.
    """
    if not fits:
        return None
    values, errors, bounds, declared, after = np.array(
        [(fit.value, fit.standard_error, fit.bound, fit.as_declared, fit.after_fit) for fit in fits]
    ).T
    sigmas = np.hypot(errors, bounds)
    middle = float(np.median(values))
    scale = np.maximum(sigmas, MAD_TO_SIGMA * float(np.median(np.abs(values - middle))))
    weights = 1.0 / (sigmas**2 * (1.0 + ((values - middle) / (_FAR * scale)) ** 2))
    weights /= weights.sum()
    value = float(weights @ values)
    spread = np.sqrt(weights**2 @ (values - value) ** 2 * len(fits) / max(len(fits) - 1, 1))
    left = np.divide(after, declared, out=np.ones_like(after), where=declared > 0)
    return Pooled(
        value=value,
        standard_error=float(max(np.sqrt(weights**2 @ errors**2), spread)),
        bound=float(weights @ bounds),
        explains=max(float(np.median(1.0 - left)), 0.0),
    )
