"""Does every stored byte decode?"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, prod

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.flow_rate_deviations import with_flow_rate_deviations
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.features import Feature
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.canonical import is_flow_stream, spec_of, timestamps_of
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window


@dataclass(frozen=True, slots=True)
class DamagedChunk:
    """A stored chunk that does not decode.

    Attributes
    ----------
    key
        Its dataset.
    chunk
        Its number.
    start, stop
        Its first row, and the row after its last.
    reason
        Message of HDF5.
    has_other_form
        Whether what is stored is sound, but of another size or depth.
    """

    key: str
    chunk: int
    start: int
    stop: int
    reason: str
    has_other_form: bool = False


@dataclass(frozen=True, slots=True)
class RowsOfOtherForm(Feature):
    """How many chunks that cannot be rows of a dataset are sound, but of another size or depth.

    Attributes
    ----------
    sound, of
        Number of such chunks, and of all that do not decode.
    """

    sound: int
    of: int


@dataclass(frozen=True, slots=True)
class ReadSummary:
    """Chunks that one window read.

    Attributes
    ----------
    touched
        Dataset, and first and last chunk (half-open) along the first axis of chunks.
    damaged
        Chunks that do not decode.
    """

    touched: tuple[tuple[str, int, int], ...]
    damaged: tuple[DamagedChunk, ...]


class IntegrityReadable(WindowCheck[ReadSummary]):
    """Does every stored chunk decode, and do the checksums match?

    For each stream, the number of chunks that cannot be decoded.

    Why it matters
    --------------
    Bytes that a disk or a broken copy damaged cause an error in the middle of a training run. Without a checksum they
    are read as values.

    How
    ---
    The rows of each planned window are decoded from every dataset of every stream, through the codec and, where the
    file has it, HDF5's Fletcher-32 checksum. Samples and index maps are read in full with the first window. A chunk
    that fails is counted once, with its rows, and the other checks continue without these rows. A stream whose
    timestamps cannot be read is not used at all.

    Noise model
    -----------
    None: a chunk decodes or does not. The coverage states how many of the file's chunks were read.

    Cannot detect
    -------------
    Damage in a dataset without checksum or compression: any bytes decode, so that only checks of the values can detect
    it. Fletcher-32 misses a random change with probability 2^-32, and 16-bit words of zeros that were replaced by ones,
    or ones by zeros.

    Sources
    -------
    HDF5 file format specification, filter 3; J. G. Fletcher, "An arithmetic checksum for serial transmissions", IEEE
    Transactions on Communications 30 (1982).
    """

    name = "integrity.readable"

    def measure(self, window: Window) -> ReadSummary:
        """Try every chunk that the window owns rows of."""
        touched: list[tuple[str, int, int]] = []
        damaged: list[DamagedChunk] = []
        for key, binding in window.facts.layout.bindings.items():
            spec = spec_of(key)
            if spec.is_image or spec.stream == "events":
                owned = window.owned(spec.stream)
                start, stop = owned.start, min(owned.stop, binding.rows)
            else:
                # Everything smaller is read as a whole, with the first window.
                start, stop = (0, binding.rows) if window.span.index == 0 else (0, 0)
            if start < stop:
                rows = _rows_in_chunk(binding)
                touched.append((key, start // rows, ceil(stop / rows)))
                damaged.extend(_damage(window, binding, start, stop))
        return ReadSummary(tuple(touched), tuple(damaged))

    def conclude(self, state: Sequence[ReadSummary], facts: Facts) -> Observation:
        """Count damaged chunks by stream."""
        bindings = facts.layout.bindings
        # Windows overlap: what they touched along the first axis of chunks counts once, by dataset.
        touched, end = Counter[str](), Counter[str]()
        for key, first, stop in sorted(block for summary in state for block in summary.touched):
            touched[key] += max(0, stop - max(first, end[key]))
            end[key] = max(end[key], stop)
        read = sum(count * _chunks_beside(bindings[key]) for key, count in touched.items())
        # Windows share chunks; reversed, so that the first window that reached a chunk describes it.
        damaged = {(chunk.key, chunk.chunk): chunk for summary in reversed(state) for chunk in summary.damaged}
        # Blocks of event timestamps that the scan could not decode, and that therefore no window owns.
        key = timestamps_of("events")
        reported = [chunk for chunk in damaged.values() if chunk.key == key]
        for start, stop in facts.events.unreadable if facts.events else ():
            if not any(chunk.start < stop and start < chunk.stop for chunk in reported):
                number = start // _rows_in_chunk(bindings[key])
                damaged[key, number] = DamagedChunk(key, number, start, stop, "their timestamps do not decode")
        stored = sum(ceil(b.rows / _rows_in_chunk(b)) * _chunks_beside(b) for b in bindings.values())
        streams = sorted({spec_of(key).stream for key in bindings})
        unusable = facts.layout.streams - facts.streams - {spec_of(key).stream for key, _ in damaged}
        statistics: list[Statistic] = []
        for stream in streams:
            name = f"{stream}.unreadable_chunks"
            if stream in unusable:
                statistics.append(
                    count_of_faults(
                        name,
                        value=1,
                        unit="chunks",
                        statement=f"{stream} cannot be used: {facts.absent.get(stream, 'it cannot be read')}",
                        code="integrity.readable.stamps",
                        where=Where(stream=stream),
                        severity="critical",
                    )
                )
                continue
            chunks = sorted(
                (chunk for chunk in damaged.values() if spec_of(chunk.key).stream == stream),
                key=lambda chunk: (chunk.start, chunk.key, chunk.chunk),
            )
            if not chunks:
                statistics.append(no_faults(name, "chunks", "integrity.readable.chunk"))
                continue
            first_chunk, blocks = chunks[0], {(chunk.key, chunk.start, chunk.stop) for chunk in chunks}
            # Columns that are stored apart hold the same rows: each range of rows counts once.
            rows = sum(stop - start for _, start, stop in blocks)
            statistics.append(
                count_of_faults(
                    name,
                    value=len(chunks),
                    unit="chunks",
                    statement=f"{len(chunks)} chunks of {stream} ({rows} rows) cannot be decoded, first rows "
                    f"{first_chunk.start} to {first_chunk.stop} of {first_chunk.key}: {first_chunk.reason}",
                    code="integrity.readable.chunk",
                    where=Where(
                        stream=stream, index_start=first_chunk.start, index_stop=max(chunk.stop for chunk in chunks)
                    ),
                    severity="critical",
                    features=(RowsOfOtherForm(sum(chunk.has_other_form for chunk in chunks), len(chunks)),),
                )
            )
        return Observation(
            Coverage(read, max(stored, read), "chunks"),
            with_flow_rate_deviations(statistics, set(filter(is_flow_stream, streams))),
        )


def _rows_in_chunk(binding: Binding) -> int:
    """Return the number of rows that are stored together; without chunks, that of the canonical layout."""
    stored = binding.stored_chunk[0] if binding.stored_chunk else binding.chunk_rows
    return max(1, stored or spec_of(binding.key).chunk_rows or binding.rows)


def _chunks_beside(binding: Binding) -> int:
    """Return the number of chunks that hold parts of the same rows: tiles of an image, or columns stored apart."""
    return prod(binding.chunk_grid[1:])


def _damage(window: Window, binding: Binding, start: int, stop: int) -> Iterator[DamagedChunk]:
    """Yield the chunks that do not decode; rows are read block by block.

    Whole chunks are yielded, also where the window owns a part of one.
    """
    rows, beside = _rows_in_chunk(binding), _chunks_beside(binding)
    together = max(rows, binding.chunk_rows)
    for block in range(start // together, ceil(stop / together)):
        first, last = block * together, min((block + 1) * together, binding.rows)
        try:
            window.rows(binding.key, max(start, first), min(stop, last))
        except UnreadableRowsError as error:
            other = error.has_other_form
            for chunk in error.chunks:
                first = chunk // beside * rows
                yield DamagedChunk(binding.key, chunk, first, min(first + rows, binding.rows), error.reason, other)
            # Chunks that were not tried one by one: the first one of the block stands for the rows that failed.
            if not error.chunks:
                yield DamagedChunk(binding.key, first // rows * beside, first, last, error.reason, other)
