"""The response model of the event sensor."""

from collections.abc import Sequence

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet
from fedora_qa.views.level_samples import LevelSums, fit_thresholds, level_coverage, level_sums


class EventResponseModel(WindowCheck[LevelSums]):
    """Do events follow the declared sensor model, of log intensity or of grey values?

    The natural logarithm of the ratio of two residuals, each in thresholds: that in the declared domain over that in
    the other one. Negative values favour the declared model.

    Why it matters
    --------------
    A sensor of the linear model gives many events in bright regions and few in dark ones. Methods that integrate events
    in the log domain fail on it without an error. The simulated DVS plugin is linear; most data sheets describe the log
    model.

    How
    ---
    The bracketed level samples of ``event_response.threshold`` are regressed in L and in luma. In the domain in which
    events have one constant step, the residual is smaller in units of its threshold. The comparison is made in every
    quarter of the image and window, and averaged.

    Noise model
    -----------
    The standard error is the spread between these blocks over the root of their number. There is no model error bound:
    errors of frames, and of levels between events, are the same in both domains, and a correct file is far below zero.

    Cannot detect
    -------------
    A scene of one brightness, where both domains are proportional: not_observable beyond a ratio of e. Smaller
    differences between models: the number of events a rendered step is visible in ``event_response.threshold`` as an
    overshoot.

    Sources
    -------
    First principles (``estimators/events/threshold_fit.py``). The linear model is that of the simulated DVS plugin, the
    log model that of the dynamic vision sensor (Lichtsteiner, Posch and Delbruck 2008).
    """

    name = "event_response.model"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> LevelSums | None:
        """Sum the window's level samples."""
        return level_sums(window)

    def conclude(self, state: Sequence[LevelSums], facts: Facts) -> Observation:
        """State the ratio of the residuals in both domains."""
        declared, coverage = facts.declared.events, level_coverage(state)
        thresholds = fit_thresholds(state, facts)
        if isinstance(thresholds, str) or declared is None:
            return Observation(coverage, unobservable=str(thresholds))
        value, error = thresholds.preference
        other = "linear" if declared.model == "log" else "log"
        ours = thresholds.fit.relative_sigma
        theirs = thresholds.other_domain.relative_sigma if thresholds.other_domain else float("inf")
        ratio = Statistic(
            name="log_residual_ratio",
            value=value,
            unit="1",
            standard_error=error,
            # Negative values favour the declared model; only positive ones contradict it.
            side="upper",
            # A natural logarithm: 1 is a ratio e of the residuals.
            statement=f"Events follow the {other} model: its residual is {theirs:.3g} thresholds, that of the "
            f"declared {declared.model} model {ours:.3g}.",
            code="event_response.model.domain",
            where=Where(stream="events"),
        )
        return Observation(coverage, (ratio,))
