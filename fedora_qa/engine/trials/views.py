"""Views of one sequence, such as those with a fault undone, and what they share.

Rows that no view alters are decoded once for all of them. Results are made once for all views in which nothing differs
that they were made from; ``sequence/inputs.py`` notes what that is.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Concatenate, Final, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.survey import Prepared
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.inputs import (
    FACTS,
    OWNED,
    InputLog,
    Inputs,
    Traced,
    TracedFields,
    TracedMapping,
    changed_inputs,
)
from fedora_qa.sequence.scan import Scan
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Leases, Sampling, Span, Window

P = ParamSpec("P")
T = TypeVar("T")
Image = TypeVar("Image", bound=NDArray[Any])

_OWN_SHARE: Final = 0.25
"""Share of the leased bytes for what one view needs alone: rows of the stream that it alters, and what follows."""


@dataclass(frozen=True, slots=True)
class SequenceViews:
    """What the views of a sequence share: its rows, and results of their windows.

    Attributes
    ----------
    facts
        Of the sequence without any alteration.
    spans
        Its windows, by their numbers.
    decoder
        Decodes its rows. The leases hold shared results as well.
    limit_bytes
        Most bytes that a view keeps beside them.
    log
        Notes what results are made from.
    """

    facts: Facts
    spans: Mapping[int, Span]
    decoder: BlockDecoder
    limit_bytes: int
    log: InputLog = field(default_factory=InputLog)

    @staticmethod
    def of(sequence: SequenceRows, ready: Prepared) -> "SequenceViews":
        """Return what views of an open sequence share; together they lease as many bytes as the sequence did."""
        own = int(_OWN_SHARE * ready.decoder.leases.limit_bytes)
        decoder = BlockDecoder(sequence, ready.scanned, ready.decoder.leases.limit_bytes - own)
        return SequenceViews(ready.facts, {span.index: span for span in ready.spans}, decoder, own)

    def prepared(self, view: SequenceRows, ready: Prepared, rows: Inputs) -> Prepared:
        """Return a view of the sequence ready to be measured with what the others have made."""
        altered = rows.union(changed_inputs(self.facts, ready.facts, FACTS))
        return replace(ready, decoder=ViewDecoder(view, ready.scanned, self, altered))

    def find(self, key: Hashable, altered: Inputs) -> Traced[Any] | None:
        """Return a shared result, and note its inputs; None where there is none, or where any of them is altered."""
        kept: Traced[Any] | None = self.decoder.leases.find(key)
        if kept is None or not kept.inputs.isdisjoint(altered):
            return None
        self.log.note(*kept.inputs)
        return kept

    def keep(self, key: Hashable, result: Traced[Any], altered: Inputs) -> bool:
        """Keep a result for other views; return False where it is that of one view alone."""
        if not result.inputs.isdisjoint(altered):
            return False
        # One that was kept before has other inputs, by which this view could not use it.
        if self.decoder.leases.find(key) is None:
            self.decoder.leases.keep(key, result)
        return True

    def altered_in(self, span: Span) -> Inputs:
        """Return the names of the streams of which a window owns other rows than without alterations."""
        plain = self.spans.get(span.index)
        same = plain is not None and (plain.start_ns, plain.stop_ns) == (span.start_ns, span.stop_ns)
        before = plain.owned if plain is not None and same else {}
        return frozenset(changed_inputs(before, span.owned, OWNED))


class ViewDecoder(BlockDecoder):
    """Rows of a view: those that it alters are its own, all others are decoded once for all views.

    Parameters
    ----------
    sequence
        The view.
    scan
        Its timestamps.
    views
        What it shares with other views.
    altered
        Rows and facts that differ from those of the sequence.
    """

    def __init__(self, sequence: SequenceRows, scan: Scan, views: SequenceViews, altered: Inputs) -> None:
        super().__init__(sequence, scan, views.limit_bytes)
        self._views = views
        self._altered = altered

    def window(self, span: Span, facts: Facts, sampling: Sampling) -> Window:
        """Begin a window, as ``BlockDecoder.window``; what views share is kept while it fits."""
        super().window(span, facts, sampling)
        self._views.decoder.leases.begin_window(lambda _: True)
        altered = self._altered | self._views.altered_in(span)
        return SharedWindow(span, facts, self, sampling, self.leases, self._views, altered)

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows in canonical units, read-only; raises ``UnreadableRowsError``."""
        self._views.log.note(key)
        if key in self._altered:
            return super().rows(key, start, stop)
        return self._views.decoder.rows(key, start, stop)

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns``, exact where the timestamps are in order."""
        self._views.log.note(timestamps_of("events"))
        return super().event_index(time_ns)


class SharedWindow(Window):
    """A window of a view, which shares results with the same window of other views.

    Parameters as of ``Window``, and ``views`` and ``altered`` as of ``ViewDecoder``.
    """

    def __init__(
        self,
        span: Span,
        facts: Facts,
        source: ViewDecoder,
        sampling: Sampling,
        leases: Leases,
        views: SequenceViews,
        altered: Inputs,
    ) -> None:
        traced = replace(span, owned=TracedMapping(span.owned, OWNED, views.log))
        super().__init__(traced, cast(Facts, TracedFields(facts, FACTS, views.log)), source, sampling, leases)
        self._views = views
        self._altered = altered
        self._place = span.index, span.start_ns, span.stop_ns, sampling
        self._traced: dict[Hashable, Traced[Any]] = {}

    def derived(self, compute: Callable[Concatenate[Window, P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return a result, computed once and shared by all checks, and with views in which nothing of it differs."""
        key = (compute, *args, *kwargs.items())
        if traced := self._traced.get(key):
            self._views.log.note(*traced.inputs)
        else:
            traced = self._shared_result((self._place, key), lambda: compute(self, *args, **kwargs))
            self._traced[key] = traced
        return cast(T, traced.value)

    def of_image(self, name: Hashable, row: int, compute: Callable[[], Image]) -> Image:
        """Return a result of one image, shared as that of ``derived`` and with neighbouring windows."""
        return self._shared_result((name, row), compute).value

    def depth_m(self, frame: int) -> NDArray[np.float32]:
        """Return a depth frame (H, W), m along the optical axis, NaN where invalid."""
        # A frame that the window has kept is not read again.
        self._views.log.note("path/depth")
        return super().depth_m(frame)

    def _shared_result(self, key: Hashable, compute: Callable[[], T]) -> Traced[T]:
        traced = self._views.find(key, self._altered) or self._leases.find(key)
        if traced is not None:
            self._views.log.note(*traced.inputs)
            return cast(Traced[T], traced)
        traced = self._views.log.trace(compute)
        if not self._views.keep(key, traced, self._altered):
            self._leases.keep(key, traced)
        return traced
