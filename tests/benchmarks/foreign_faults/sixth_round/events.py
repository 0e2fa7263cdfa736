"""Events, and the index maps into them, that transports, simulators, transforms and converters change."""

from typing import Any, Final

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, POLARITY, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import COLOUR_MAP, DEPTH_MAP
from tests.benchmarks.foreign_faults.second_round.events import TIME, keep_events, sensor_size, sort_events
from tests.benchmarks.foreign_faults.sensor import LUMA

PACKET_US: Final = 1000
"""Length of a packet of a driver."""


def packets_exchanged(file: h5py.File, plan: Plan) -> None:
    """Within the plan's rows, every two packets in sequence, of so many events each, are exchanged."""
    count = len(file[TIME])
    rows = plan.rows(count)
    packet = min(int(plan.size), (rows.stop - rows.start) // 2)
    pairs = (rows.stop - rows.start) // (2 * packet)
    order = np.arange(count)
    part = slice(rows.start, rows.start + 2 * packet * pairs)
    order[part] = order[part].reshape(pairs, 2, packet)[:, ::-1].ravel()
    for key in (TIME, COLUMNS, ROWS, POLARITY):
        replace_values(file, key, file[key][...][order])


def busiest_packets_lost(file: h5py.File, plan: Plan) -> None:
    """Of the packets of 1 ms within the plan's time, the so many percent with the most events are lost."""
    timestamps_us = file[TIME][...]
    within = plan.times_us(timestamps_us)
    packets = (timestamps_us - timestamps_us[0]) // PACKET_US
    numbers, inverse, sizes = np.unique(packets[within], return_inverse=True, return_counts=True)
    lost = np.zeros(len(numbers), dtype=bool)
    lost[np.argsort(sizes, kind="stable")[len(numbers) - max(1, round(plan.size / 100 * len(numbers))) :]] = True
    kept = np.ones(len(timestamps_us), dtype=bool)
    kept[within] = ~lost[inverse]
    keep_events(file, kept)


def _log_luma(frame: NDArray[Any], size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the logarithm of a frame's luma at the pixels of the sensor (H, W), at least that of 1 DN."""
    luma = np.asarray(frame @ LUMA, dtype=np.float64)
    return np.log(np.maximum(cv2.resize(luma, size, interpolation=cv2.INTER_AREA), 1.0))


def of_pairs_of_frames(file: h5py.File, plan: Plan) -> None:
    """Events are of the file's own frames: of each pair of them, the whole thresholds of the change of log luma.

    They lie evenly between the two frames; what is left of a threshold is not carried on.
    """
    attributes, size = file["metadata/events"].attrs, sensor_size(file)
    thresholds = [float(attributes[name]) for name in ("threshold_off", "threshold_on")]
    frames_us = file["path/rgb_ts"][...]
    before = _log_luma(file["path/rgb"][0], size)
    parts: list[NDArray[np.float64]] = []
    for number in range(1, len(frames_us)):
        after = _log_luma(file["path/rgb"][number], size)
        change = (after - before).ravel()
        counts = np.floor(np.abs(change) / np.where(change > 0, thresholds[1], thresholds[0])).astype(np.int64)
        pixels = np.repeat(np.arange(change.size), counts)
        places = np.arange(len(pixels)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
        share = places / np.repeat(counts, counts)
        times_us = frames_us[number - 1] + share * (frames_us[number] - frames_us[number - 1])
        parts.append(np.stack([pixels, np.rint(times_us), change[pixels] > 0]))
        before = after
    pixels, times_us, polarity = np.concatenate(parts, axis=1).astype(np.int64)
    for key, values in {
        TIME: times_us,
        POLARITY: polarity,
        COLUMNS: pixels % size[0],
        ROWS: pixels // size[0],
    }.items():
        replace_values(file, key, values.astype(file[key].dtype))
    sort_events(file)


def polarity_of_four_values(file: h5py.File, plan: Plan) -> None:
    """Polarities are 0 to 3: half of all, anywhere, are too large by 2."""
    polarity = file[POLARITY][...]
    more = 2 * plan.random.integers(2, size=len(polarity))
    replace_values(file, POLARITY, polarity + more.astype(polarity.dtype))


def polarity_always_1(file: h5py.File, plan: Plan) -> None:
    """All events are of brighter pixels."""
    replace_values(file, POLARITY, np.ones_like(file[POLARITY][...]))


def depth_map_from_1(file: h5py.File, plan: Plan) -> None:
    """Entries count from 1."""
    replace_values(file, DEPTH_MAP, file[DEPTH_MAP][...] + 1)


def cut_behind_the_colour_map(file: h5py.File, plan: Plan) -> None:
    """The first so many percent of the events are absent, which the colour map still counts."""
    entries = file[COLOUR_MAP][...]
    count = len(file[TIME])
    keep_events(file, np.arange(count) >= max(1, round(plan.size / 100 * count)))
    replace_values(file, COLOUR_MAP, entries)


def colour_map_of_whole_messages(file: h5py.File, plan: Plan) -> None:
    """An entry is where the message of so many ms ends within which its frame lies."""
    timestamps_us, frames_us = file[TIME][...], file["path/rgb_ts"][...]
    length_us = 1000 * plan.size
    messages = np.floor((frames_us - timestamps_us[0]) / length_us) + 1
    ends = np.searchsorted(timestamps_us, timestamps_us[0] + messages * length_us)
    replace_values(file, COLOUR_MAP, np.where(frames_us < timestamps_us[0], 0, ends).astype(np.int64))
