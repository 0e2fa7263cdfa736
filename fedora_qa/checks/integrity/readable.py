"""Does every stored byte decode?"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, prod

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.families import over_all_rates
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.canonical import DATASETS, FLOW_STREAMS, TIMESTAMPS_OF
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window


@dataclass(frozen=True, slots=True)
class Damage:
    """A stored chunk that does not decode: its dataset, number, first and last row (half-open), and HDF5's words."""

    key: str
    chunk: int
    start: int
    stop: int
    reason: str


@dataclass(frozen=True, slots=True)
class ReadSummary:
    """What one window touched: a range along the first axis of chunks for each dataset, and those that are damaged."""

    touched: tuple[tuple[str, int, int], ...]
    damaged: tuple[Damage, ...]


class IntegrityReadable(WindowCheck[ReadSummary]):
    """Does every stored chunk decode, and do the checksums hold?

    The chunks that cannot be decoded, counted for each stream.

    Why it matters
    --------------
    Bytes that were damaged by a disk or a broken copy come back as an error in the middle of a training run, or,
    without a checksum, as values.

    How
    ---
    The rows of each planned window are decoded from every dataset of every stream, through the codec and HDF5's
    Fletcher-32 checksum where the file has one; samples and index maps are read in full with the first window. A
    chunk that fails is counted once, with its rows, and the other checks go on without them. A stream whose stamps
    cannot be read is lost as a whole.

    Noise model
    -----------
    None: a chunk decodes or not. The coverage says how many of the file's chunks were read.

    Cannot see
    ----------
    Damage in a dataset without checksum or compression, which decodes whatever its bytes are: there only the values
    tell. Fletcher-32 misses a change of 32 bits in 2^32 by chance, and words of 16 bits that were exchanged for zeros
    or ones.

    Sources
    -------
    HDF5 file format specification, filter 3; J. G. Fletcher, "An arithmetic checksum for serial transmissions", IEEE
    Transactions on Communications 30 (1982).
    """

    name = "integrity.readable"

    def measure(self, window: Window) -> ReadSummary:
        """Try every chunk that the window owns rows of."""
        touched: list[tuple[str, int, int]] = []
        damaged: list[Damage] = []
        for key, binding in window.facts.layout.bindings.items():
            start, stop = _rows_to_read(window, key, binding)
            if start < stop:
                rows = _rows_in_chunk(binding)
                touched.append((key, start // rows, ceil(stop / rows)))
                damaged.extend(_damage(window, binding, start, stop))
        return ReadSummary(tuple(touched), tuple(damaged))

    def conclude(self, state: Sequence[ReadSummary], facts: Facts) -> Observation:
        """Count damaged chunks by stream."""
        bindings = facts.layout.bindings
        seen = sum(count * _chunks_beside(bindings[key]) for key, count in _seen(state).items())
        damaged = {(one.key, one.chunk): one for seen in reversed(state) for one in seen.damaged}
        damaged |= {(one.key, one.chunk): one for one in _damage_in_scan(facts, list(damaged.values()))}
        of = sum(ceil(one.rows / _rows_in_chunk(one)) * _chunks_beside(one) for one in bindings.values())
        streams = sorted({DATASETS[key].stream for key in bindings})
        lost = facts.layout.streams - facts.streams - {DATASETS[key].stream for key, _ in damaged}
        return Observation(
            Coverage(seen, max(of, seen), "chunks"),
            over_all_rates(
                (
                    self._lost(facts, stream) if stream in lost else self._of_stream(stream, list(damaged.values()))
                    for stream in streams
                ),
                set(streams) & set(FLOW_STREAMS),
            ),
        )

    def _of_stream(self, stream: str, damaged: Sequence[Damage]) -> Statistic:
        ours = sorted(
            (one for one in damaged if DATASETS[one.key].stream == stream),
            key=lambda one: (one.start, one.key, one.chunk),
        )
        if not ours:
            return no_faults(f"{stream}.unreadable_chunks", "chunks", "integrity.readable.chunk")
        first, rows = ours[0], sum(stop - start for _, start, stop in {(one.key, one.start, one.stop) for one in ours})
        return count_of_faults(
            name=f"{stream}.unreadable_chunks",
            value=len(ours),
            unit="chunks",
            statement=f"{len(ours)} chunks of {stream} ({rows} rows) cannot be decoded, first rows {first.start} to "
            f"{first.stop} of {first.key}: {first.reason}",
            code="integrity.readable.chunk",
            where=Where(stream=stream, index_start=first.start, index_stop=max(one.stop for one in ours)),
            severity="critical",
            suspects=(Suspect("corrupt_chunk", stream, 1.0, float(len(ours)), "chunks"),),
        )

    def _lost(self, facts: Facts, stream: str) -> Statistic:
        return count_of_faults(
            name=f"{stream}.unreadable_chunks",
            value=1,
            unit="chunks",
            statement=f"{stream} cannot be used: {facts.absent.get(stream, 'it cannot be read')}",
            code="integrity.readable.stamps",
            where=Where(stream=stream),
            severity="critical",
            suspects=(Suspect("corrupt_chunk", stream, 1.0, 1.0, "chunks"),),
        )


def _rows_to_read(window: Window, key: str, binding: Binding) -> tuple[int, int]:
    """Images and events: what the window owns. Everything smaller: all of it, with the first window."""
    spec = DATASETS[key]
    if spec.is_image or spec.stream == "events":
        owned = window.owned(spec.stream)
        return owned.start, min(owned.stop, binding.rows)
    return (0, binding.rows) if window.span.index == 0 else (0, 0)


def _rows_in_chunk(binding: Binding) -> int:
    """Rows that are stored together; where nothing is stored in chunks, as many as the canonical layout has."""
    stored = binding.stored_chunk[0] if binding.stored_chunk else binding.chunk_rows
    return max(1, stored or DATASETS[binding.key].chunk_rows or binding.rows)


def _chunks_beside(binding: Binding) -> int:
    """Chunks that hold parts of the same rows: tiles of an image, columns that are stored apart."""
    return prod(binding.chunk_grid[1:])


def _seen(state: Sequence[ReadSummary]) -> dict[str, int]:
    """Count what windows touched along the first axis of chunks, each once, by dataset."""
    seen, end = Counter[str](), Counter[str]()
    for key, first, stop in sorted(touched for one in state for touched in one.touched):
        seen[key] += max(0, stop - max(first, end[key]))
        end[key] = max(end[key], stop)
    return seen


def _damage(window: Window, binding: Binding, start: int, stop: int) -> Iterator[Damage]:
    """Decode rows block by block; what fails are whole chunks, also where the window owns a part of one."""
    rows, beside = _rows_in_chunk(binding), _chunks_beside(binding)
    together = max(rows, binding.chunk_rows)
    for block in range(start // together, ceil(stop / together)):
        first, last = block * together, min((block + 1) * together, binding.rows)
        try:
            window.rows(binding.key, max(start, first), min(stop, last))
        except UnreadableRowsError as error:
            for chunk in error.chunks:
                first = chunk // beside * rows
                yield Damage(binding.key, chunk, first, min(first + rows, binding.rows), error.reason)
            if not error.chunks:
                yield Damage(binding.key, first // rows * beside, first, last, error.reason)


def _damage_in_scan(facts: Facts, damaged: Sequence[Damage]) -> Iterator[Damage]:
    """Yield the blocks of event stamps that the scan could not decode and that therefore no window owns."""
    key = TIMESTAMPS_OF["events"]
    known = [one for one in damaged if one.key == key]
    for start, stop in facts.events.unreadable if facts.events else ():
        if not any(one.start < stop and start < one.stop for one in known):
            chunk = start // _rows_in_chunk(facts.layout.bindings[key])
            yield Damage(key, chunk, start, stop, "their stamps do not decode")
