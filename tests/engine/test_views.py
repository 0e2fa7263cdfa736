"""Views of a sequence share what nothing altered went into, and nothing else."""

import gc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.measure import PassState, conclude, measure
from fedora_qa.engine.outcomes import why_not_applicable
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Prepared, prepare
from fedora_qa.engine.trials.altered import PlainRun
from fedora_qa.engine.trials.views import SequenceViews
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.declarations import ThresholdMisdeclared
from fedora_qa.faults.fault import Fault, FaultySequence, ReversibleFault
from fedora_qa.faults.pixels import Mirroring
from fedora_qa.faults.units import LengthUnit
from fedora_qa.sequence.inputs import TracedFields, TracedMapping
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.sequence.window import Sampling, Window
from tests.support.all_checks import CHECKS
from tests.support.identical import identical

MEMORY_BYTES = 1 << 28
FAULTS: tuple[ReversibleFault, ...] = (
    ClockShift("events", 3_000_000.0),
    Mirroring("rgb", "horizontal"),
    LengthUnit("depth", 1000.0),
    ThresholdMisdeclared(20.0, 20.0),
    ClockShift("flow", 20_000_000.0),
)
"""Of time, images, values with another stored step, and declarations."""


class Views:
    """A sequence, its checks, and the views of it with faults planted."""

    def __init__(self, sequence: Sequence) -> None:
        self.sequence = sequence
        self.ready = prepare(sequence, MEMORY_BYTES)
        self.checks: list[Check[Any]] = [check for check in CHECKS if not why_not_applicable(check, self.ready.facts)]

    def run(self) -> PlainRun:
        """Return a run whose views have shared nothing yet."""
        views = SequenceViews.of(self.sequence, self.ready)
        ready = views.prepared(self.sequence, self.ready, frozenset())
        return PlainRun(self.sequence, ready, {}, {}, "full", 1e-3, views)

    def measured(self, ready: Prepared) -> PassState:
        """Return the states of all checks after the first window."""
        return measure(self.checks, ready.spans[:1], ready.facts, ready.decoder, Sampling(0.25), quiet)

    def observed(self, ready: Prepared) -> dict[str, Observation]:
        """Return what all checks observe in these windows."""
        return conclude(self.checks, self.measured(ready), ready.facts)


@pytest.fixture(scope="module")
def sequence_views(tiny_park_day: Path) -> Iterator[Views]:
    with open_sequence(tiny_park_day) as sequence:
        yield Views(sequence)


def alone(views: Views, fault: Fault) -> Prepared:
    """Return a view that shares nothing."""
    ready = views.run().altered_by(fault)
    decoder = BlockDecoder(FaultySequence(views.sequence, fault), ready.scanned, MEMORY_BYTES)
    return replace(ready, decoder=decoder)


def test_sharing_changes_no_bit(sequence_views: Views) -> None:
    """Each view measures what it measures alone, whatever the others have made before it."""
    run = sequence_views.run()
    faults = [fault.plant(run.ready.facts, run.sequence) for fault in FAULTS]
    for fault in (Fault("nothing"), *faults, faults[0]):
        ready = run.altered_by(fault)
        shared, expected = sequence_views.observed(ready), sequence_views.observed(alone(sequence_views, fault))
        assert shared.keys() == expected.keys(), fault.description
        differing = [name for name in expected if not identical(shared[name], expected[name])]
        assert not differing, fault.description


def test_rows_that_no_view_alters_are_decoded_once(sequence_views: Views) -> None:
    """The second view decodes the stream that it alters, and no other."""
    run = sequence_views.run()
    sequence_views.measured(run.ready)
    decoded = run.views.decoder.decoded_bytes
    altered = run.altered_by(Mirroring("rgb", "horizontal").plant(run.ready.facts, run.sequence))
    sequence_views.measured(altered)
    assert run.views.decoder.decoded_bytes == decoded
    binding = run.ready.facts.layout.bindings["path/rgb"]
    assert 0 < altered.decoder.decoded_bytes <= np.prod(binding.shape)


def test_checks_of_other_streams_measure_nothing_again(sequence_views: Views) -> None:
    """Their summaries are those of the plain view: the same objects."""
    run = sequence_views.run()
    plain = sequence_views.measured(run.ready)
    fault = Mirroring("rgb", "horizontal").plant(run.ready.facts, run.sequence)
    mirrored = sequence_views.measured(run.altered_by(fault))
    for name in ("depth.scale", "flow_geometry.endpoint", "event_stream.gaps"):
        pairs = list(zip(plain.states[name], mirrored.states[name], strict=True))
        assert pairs, name
        assert all(before is after for before, after in pairs), name
    assert not identical(plain.states["images.order"], mirrored.states["images.order"])


def test_leases_of_views_are_bounded(sequence_views: Views) -> None:
    """Shared and own arrays together take no more than the file's own leases may."""
    limit = sequence_views.ready.decoder.leases.limit_bytes
    run = sequence_views.run()
    fault = Mirroring("rgb", "horizontal").plant(run.ready.facts, run.sequence)
    assert run.views.decoder.leases.limit_bytes + run.altered_by(fault).decoder.leases.limit_bytes <= limit


def test_shared_results_refer_to_no_view(sequence_views: Views) -> None:
    """A result that held its window would read from that view later."""
    run = sequence_views.run()
    sequence_views.measured(run.ready)
    leases = run.views.decoder.leases
    waiting: list[Any] = [*leases._before.values(), *leases._now.values()]
    visited: set[int] = set()
    while waiting:
        value = waiting.pop()
        if id(value) in visited or isinstance(value, type):
            continue
        visited.add(id(value))
        assert not isinstance(value, Window | TracedFields | TracedMapping), type(value)
        if type(value).__module__.startswith("fedora_qa") or isinstance(value, dict | list | tuple):
            waiting.extend(gc.get_referents(value))
    assert len(visited) > 100
