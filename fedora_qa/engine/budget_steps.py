"""The steps of a file that is checked within a budget of time; like all steps they can be done by any process.

Checks that need neither images nor events get every window, first and in one step. All others get windows one by one,
in the order in which they are visited. Each window gives a state of its own; in the end these are merged in the order
of time.
"""

import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fedora_qa.engine.effort import Effort
from fedora_qa.engine.finish import finish_open
from fedora_qa.engine.options import FileRun
from fedora_qa.engine.partial_pass import STAGE, PartialPass, together
from fedora_qa.engine.plan import Plan, sees_every_window
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import Accumulator, PassState, measure
from fedora_qa.engine.survey import OpenSurvey, Survey, opened
from fedora_qa.storage.traffic import Traffic


@dataclass(frozen=True, slots=True)
class SampledPasses:
    """Passes over a file so far: of the checks that get every window, and of all others by window."""

    steady: tuple[PartialPass, ...]
    sampled: Mapping[int, PartialPass]


def has_steady_checks(survey: Survey) -> bool:
    """Whether any check gets every window."""
    return any(sees_every_window(check.needs) for check in survey.asked)


def measure_steady(survey: Survey, windows: Sequence[int], progress: Progress) -> PartialPass:
    """Hand neighbouring windows to the checks that get every window."""
    with opened(survey) as file:
        return _measured(survey, file, _steady(file), windows, progress)


def measure_sampled(
    survey: Survey, windows: Sequence[int], allowed_s: float, progress: Progress
) -> dict[int, PartialPass]:
    """Hand windows one by one to all other checks, in the given order, while they fit into a time; one at least."""
    began = time.monotonic()
    with opened(survey) as file:
        accumulators = _sampled(file)
        passes: dict[int, PartialPass] = {}
        longest_s = 0.0
        for done, window in enumerate(windows):
            left_s = allowed_s - (time.monotonic() - began)
            # One window at least: ``Pace.add`` divides by the number of windows of a step.
            if passes and longest_s > left_s:
                break
            progress(STAGE, done, len(windows))
            passes[window] = _measured(survey, file, accumulators, [window], quiet)
            longest_s = max(longest_s, passes[window].seconds)
        return passes


def finish_sampled(survey: Survey, passes: SampledPasses, lost: Sequence[int], progress: Progress) -> FileRun:
    """Judge a file by the passes over its windows. ``lost`` are windows of the plan that could not be measured."""
    with opened(survey) as file:
        return _finished(survey, file, passes, lost, progress)


def rehearse(survey: Survey, passes: SampledPasses, progress: Progress) -> Traffic:
    """Judge a copy of the passes, so that its duration can be measured; return the traffic that this caused."""
    # Merging and concluding may change the states, which later windows still have to be merged with.
    copy = pickle.loads(pickle.dumps(passes))
    with opened(survey) as file:
        _finished(survey, file, copy, (), progress)
        return file.sequence.traffic


def at_density(survey: Survey, plan: Plan, effort: Effort) -> Survey:
    """Return the survey with another plan, of an effort's density."""
    return replace(survey, plan=plan, options=replace(survey.options, effort=effort))


def _finished(
    survey: Survey, file: OpenSurvey, passes: SampledPasses, lost: Sequence[int], progress: Progress
) -> FileRun:
    facts = file.ready.facts
    steady = together(passes.steady, _steady(file), facts)
    # States merge only in the order of time, whatever the order of visits was.
    sampled = together((part for _, part in sorted(passes.sampled.items())), _sampled(file), facts)
    # No name is in both: ``_sampled`` leaves out the steady checks.
    both = PartialPass(
        PassState(
            {**steady.states.states, **sampled.states.states},
            {**steady.states.missed, **sampled.states.missed},
            {**steady.states.crashes, **sampled.states.crashes},
            {**steady.states.seconds, **sampled.states.seconds},
        ),
        steady.seconds + sampled.seconds,
        steady.decoded_bytes + sampled.decoded_bytes,
        steady.traffic + sampled.traffic,
    )
    # ``lost`` holds numbers of the plan, ``finish_open`` takes places among the windows of the survey.
    return finish_open(survey, file, [both], [survey.windows.index(window) for window in lost], progress)


def _measured(
    survey: Survey, file: OpenSurvey, accumulators: Sequence[Accumulator], windows: Sequence[int], progress: Progress
) -> PartialPass:
    watch, ready = Stopwatch(), file.ready
    # Both count from the opening of the file, which several passes of a step share.
    decoded_before, traffic_before = ready.decoder.decoded_bytes, file.sequence.traffic
    with watch.stage(STAGE):
        spans = [ready.spans[window] for window in windows]
        sampling = survey.plan.sampling
        states = measure(accumulators, spans, ready.facts, ready.decoder, sampling, progress, ready.images)
    traffic = file.sequence.traffic - traffic_before
    return PartialPass(states, watch.seconds[STAGE], ready.decoder.decoded_bytes - decoded_before, traffic)


def _steady(file: OpenSurvey) -> tuple[Accumulator, ...]:
    return tuple(check for check in file.asked if sees_every_window(check.needs))


def _sampled(file: OpenSurvey) -> tuple[Accumulator, ...]:
    steady = _steady(file)
    return tuple(accumulator for accumulator in file.accumulators if accumulator not in steady)
