"""All tables of a study together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.power.detection import by_cause, detections, false_alarms
from fedora_qa.power.magnitudes import magnitude_errors
from fedora_qa.power.naming import confusions, naming
from fedora_qa.power.sources import estimators_digest
from fedora_qa.power.stated_limits import stated_limits
from fedora_qa.power.study import Trial
from fedora_qa.record.power_types import POWER_VERSION, Power
from fedora_qa.record.types import Tool


@dataclass(frozen=True, slots=True)
class Origin:
    """Of which corpus, begun when, and how its files were checked."""

    corpus: str
    started: str
    config: CheckConfig


def power_of(trials: Sequence[Trial], origin: Origin) -> Power:
    """Return all tables of the trials."""
    clean = {trial.item.file: trial for trial in trials if trial.item.is_clean}
    # A copy of a clean file that fails by itself may fail by that false alarm, and not by its fault.
    informative = [trial for trial in trials if not _of_a_false_alarm(trial, clean)]
    causes = by_cause(informative)
    stated = [stated_limits(sized, clean) for sized in causes]
    return Power(
        power_version=POWER_VERSION,
        ruleset_version=RULESET_VERSION,
        tool=Tool("fedora-qa", __version__),
        estimators_digest=estimators_digest(),
        config_digest=origin.config.digest,
        effort=origin.config.effort,
        corpus=origin.corpus,
        started=origin.started,
        files=len(trials),
        clean=len(clean),
        crashed=tuple(trial.item.file for trial in trials if trial.checked.crashed),
        set_aside=len(trials) - len(informative),
        false_alarms=false_alarms(trials, origin.config.false_alarm_rate),
        naming=naming(informative),
        detections=tuple(row for sized in causes for row in detections(sized)),
        confusions=confusions(informative),
        magnitudes=magnitude_errors(informative),
        stated=tuple(row for true, _ in stated for row in true),
        not_comparable=tuple(row for _, other in stated for row in other),
    )


def _of_a_false_alarm(trial: Trial, clean: Mapping[str, Trial]) -> bool:
    """Whether a faulty file is a copy of a clean one that failed itself."""
    base = clean.get(trial.item.base or "")
    return base is not None and base.checked.is_found
