"""Hypotheses for events that follow another sensor model than the declared one."""

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts


def propose_model(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Propose the other model, and frames whose transfer bends one domain into the other."""
    return (
        Hypothesis("event_model_misdeclared", "events", support("event_response.model_of_other_domain")),
        Hypothesis("exposure_or_gamma", "rgb", support("event_response.transfer_of_other_domain")),
    )
