"""The outcome does not depend on how windows are dealt out."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fedora_qa.checks.protocol import Check
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.measure import Accumulator, PassState, conclude, measure, merge
from fedora_qa.engine.outcomes import why_not_applicable
from fedora_qa.engine.plan import cut_windows
from fedora_qa.engine.progress import quiet
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.sequence.window import Sampling, Span
from fedora_qa.statistics.collector import StatisticsCollector
from tests.support.all_checks import CHECKS
from tests.support.identical import identical
from tests.support.sequences import make_sequence

CELL_NS = 100_000_000


class Bench:
    """A sequence cut into windows, and what every check says of each stretch of windows."""

    def __init__(self, sequence: Sequence) -> None:
        self.sequence = sequence
        self.scanned: Scan = scan(sequence, CELL_NS)
        self.spans: tuple[Span, ...] = cut_windows(self.scanned)
        self.checks: list[Check[Any]] = [c for c in CHECKS if not why_not_applicable(c, self.scanned.facts)]
        self.collectors = [StatisticsCollector(), EvidenceCollector(self.spans, self.spans, EvidenceOptions())]
        self.accumulators: list[Accumulator] = [*self.checks, *self.collectors]

    def measure(self, start: int, stop: int, limit_bytes: int = 1 << 26) -> PassState:
        decoder = BlockDecoder(self.sequence, self.scanned, limit_bytes)
        return measure(self.accumulators, self.spans[start:stop], self.scanned.facts, decoder, Sampling(), quiet)

    def conclude(self, states: PassState) -> dict[str, Any]:
        assert not states.crashes, "\n".join(states.crashes.values())
        facts = self.scanned.facts
        kept = {one.name: one.conclude(states.states[one.name], facts) for one in self.collectors}
        return {**conclude(self.checks, states, facts), **kept}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Half a second in windows of a tenth, as small as gives every check something to merge."""
    path = make_sequence(tmp_path_factory.mktemp("merging") / "park-day.h5", "park-day", 0.5, 120, 90)
    with open_sequence(path) as sequence:
        yield Bench(sequence)


@pytest.fixture(scope="module")
def in_one_piece(bench: Bench) -> dict[str, Any]:
    return bench.conclude(bench.measure(0, len(bench.spans)))


@settings(max_examples=3, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cuts=st.lists(st.integers(0, 999), min_size=1, max_size=4),
    pairs=st.lists(st.integers(0, 999), min_size=4, max_size=4),
    limit_bytes=st.sampled_from([1, 1 << 26]),
)
def test_random_cuts_and_merges_change_no_bit(
    cuts: list[int], pairs: list[int], limit_bytes: int, bench: Bench, in_one_piece: dict[str, Any]
) -> None:
    """Cut anywhere, measure each batch alone with any memory, merge neighbours in any order: the same bits.

    Neither does it matter that the first batch has been concluded before: larger trials go on from smaller ones.
    """
    count = len(bench.spans)
    bounds = [0, *sorted({1 + cut % (count - 1) for cut in cuts}), count]
    parts = [bench.measure(start, stop, limit_bytes) for start, stop in pairwise(bounds)]
    conclude(bench.checks, parts[0], bench.scanned.facts)
    for pair in pairs[: len(parts) - 1]:
        i = pair % (len(parts) - 1)
        parts[i : i + 2] = [merge(bench.accumulators, parts[i], parts[i + 1])]
    (whole,) = parts
    outcome = bench.conclude(whole)
    assert outcome.keys() == in_one_piece.keys()
    differing = [name for name in outcome if not identical(outcome[name], in_one_piece[name])]
    assert not differing


def test_windows_own_every_row_once(bench: Bench) -> None:
    """Every row of every stream belongs to exactly one window."""
    for stream, runs in bench.scanned.runs.items():
        owned = [row for span in bench.spans for row in range(*span.owned.get(stream, (0, 0)))]
        assert owned == list(range(runs.count)), stream


def test_comparison_can_fail(bench: Bench, in_one_piece: dict[str, Any]) -> None:
    """Half of the windows do not give the same bits as all."""
    half = bench.conclude(bench.measure(0, len(bench.spans) // 2))
    assert any(not identical(half[name], in_one_piece[name]) for name in half)
