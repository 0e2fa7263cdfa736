"""The response model of the event sensor."""

from fedora_qa.checks.event_response.threshold import EVENTS
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.threshold_fit import Answer, LevelCheck


class EventResponseModel(LevelCheck):
    """Do events follow the declared sensor model, of log intensity or of grey values?

    The logarithm of the ratio of two residuals, in thresholds: of the declared domain over the other one. Negative
    values favour what is declared.

    Why it matters
    --------------
    A sensor of the linear model fires by contrast in bright places and hardly in dark ones; methods that integrate
    events in the log domain fail on it silently. The simulated DVS plugin is linear, most data sheets mean log.

    How
    ---
    The same bracketed level samples as in event_response.threshold are regressed in L and in luma. The domain in
    which events step by one constant leaves the smaller residual in units of its threshold. The comparison is made in
    every quarter of the image and window, and averaged.

    Noise model
    -----------
    The standard error is the spread between these blocks over the root of their number. There is no allowance: errors
    of frames and of levels between events are the same in both domains, and an honest file lies far below zero.

    Cannot see
    ----------
    A scene of one brightness, where both domains are proportional: not_observable beyond a ratio of e. Finer
    differences of models: the number of events a step shows in event_response.threshold as an overshooting step.

    Sources
    -------
    First principles (event_fit). The linear model is that of the simulated DVS plugin, the log model that of the
    dynamic vision sensor (Lichtsteiner, Posch and Delbruck 2008).
    """

    name = "event_response.model"

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Statistic, ...]:
        """State how much better the other domain fits."""
        value, error = found.preference
        other = "linear" if declared.model == "log" else "log"
        ours, theirs = found.fit.relative_sigma, found.other.relative_sigma if found.other else float("inf")
        return (
            Statistic(
                name="log_residual_ratio",
                value=value,
                unit="1",
                standard_error=error,
                side="upper",
                material=1.0,
                statement=f"Events follow the {other} model: its residual is {theirs:.3g} thresholds, that of the "
                f"declared {declared.model} model {ours:.3g}.",
                code="event_response.model.domain",
                where=EVENTS,
                suspects=(
                    Suspect("event_model_misdeclared", "events", 0.95),
                    Suspect("exposure_or_gamma", "rgb", 0.3),
                ),
            ),
        )
