"""Stamps that go wrong, and rows that get lost, doubled or out of order."""

import h5py
import numpy as np

from fedora_qa.layout.canonical import TIMESTAMPS_OF
from tests.benchmarks.foreign.rows import keep_rows, present_keys, replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan, Plant

FLOW: tuple[str, ...] = ("flow/10hz", "flow/25hz", "flow/50hz")


def _streams(stream: str) -> tuple[str, ...]:
    return FLOW if stream == "flow" else (stream,)


def _restamp(file: h5py.File, stream: str, values: np.ndarray) -> None:
    key = TIMESTAMPS_OF[stream]
    replace_values(file, key, np.asarray(values).astype(file[key].dtype))


def _sort(file: h5py.File, stream: str) -> None:
    stamps_us = file[TIMESTAMPS_OF[stream]][...]
    keep_rows(file, stream, np.argsort(stamps_us, kind="stable"))


def delayed(stream: str) -> Plant:
    """Stamps of a stream are late by a constant, ms; a negative one makes them early."""

    def plant(file: h5py.File, plan: Plan) -> None:
        for name in _streams(stream):
            stamps_us = file[TIMESTAMPS_OF[name]][...]
            _restamp(file, name, stamps_us + round(1000 * plan.size))
        update_index_maps(file)

    return plant


def stepped(stream: str) -> Plant:
    """The clock steps forwards, ms, at an instant, and stays ahead."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        instant_us = stamps_us[0] + plan.begin * (stamps_us[-1] - stamps_us[0])
        _restamp(file, stream, np.where(stamps_us >= instant_us, stamps_us + round(1000 * plan.size), stamps_us))
        update_index_maps(file)

    return plant


def drifting(stream: str) -> Plant:
    """The clock of a stream gains so many ppm."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        elapsed_us = stamps_us - stamps_us[0]
        _restamp(file, stream, stamps_us[0] + np.rint(elapsed_us * (1 + plan.size / 1e6)))
        update_index_maps(file)

    return plant


def floored(stream: str) -> Plant:
    """Stamps lose what lies below a tick, us."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        _restamp(file, stream, stamps_us - stamps_us % int(plan.size))
        update_index_maps(file)

    return plant


def arrival_of_packets(file: h5py.File, plan: Plan) -> None:
    """Within a while, events carry the time at which their packet, us, was complete."""
    stamps_us = file["path/events/t"][...]
    within = plan.times_us(stamps_us)
    packet_us = int(plan.size)
    end_us = (stamps_us // packet_us + 1) * packet_us
    # The last packet ends before the events that follow it, as the reader sends what it has.
    after_us = stamps_us[~within & (np.arange(len(stamps_us)) > np.argmax(within))]
    latest_us = after_us[0] if len(after_us) else stamps_us[-1]
    _restamp(file, "events", np.where(within, np.minimum(end_us, latest_us), stamps_us))
    update_index_maps(file)


def single_precision_seconds(stream: str) -> Plant:
    """Stamps were float32 seconds since the computer was started, so many seconds before."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        uptime_s = float(np.rint(plan.size))
        seconds = (stamps_us / 1e6 + uptime_s).astype(np.float32)
        _restamp(file, stream, np.rint((seconds.astype(np.float64) - uptime_s) * 1e6))
        update_index_maps(file)

    return plant


def in_unit(stream: str, per_us: float) -> Plant:
    """Stamps are whole numbers of another unit, of which a microsecond has ``per_us``."""

    def plant(file: h5py.File, plan: Plan) -> None:
        _restamp(file, stream, np.rint(file[TIMESTAMPS_OF[stream]][...] * per_us))
        update_index_maps(file)

    return plant


def counter_reset(stream: str) -> Plant:
    """The counter of microseconds starts again at zero in the middle."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        instant_us = stamps_us[len(stamps_us) // 4 + int(plan.begin * len(stamps_us) / 2)]
        _restamp(file, stream, np.where(stamps_us >= instant_us, stamps_us - instant_us, stamps_us))

    return plant


def counter_wrap(stream: str) -> Plant:
    """The counter has 16 bits and counts units of so many us."""

    def plant(file: h5py.File, plan: Plan) -> None:
        _restamp(file, stream, file[TIMESTAMPS_OF[stream]][...] % round(65_536 * plan.size))

    return plant


def jittering(stream: str) -> Plant:
    """Stamps within the plan's time scatter with a standard deviation, ms, and rows are sorted by them."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        moved_us = stamps_us + np.rint(plan.random.normal(0.0, 1000 * plan.size, len(stamps_us))).astype(np.int64)
        moved_us = np.clip(moved_us, stamps_us[0], stamps_us[-1])
        _restamp(file, stream, np.where(plan.times_us(stamps_us), moved_us, stamps_us))
        _sort(file, stream)
        update_index_maps(file)

    return plant


def gap(file: h5py.File, plan: Plan) -> None:
    """Events of a while, ms, are lost."""
    stamps_us = file["path/events/t"][...]
    middle_us = stamps_us[0] + 0.5 * (plan.begin + plan.end) * (stamps_us[-1] - stamps_us[0])
    keep_rows(file, "events", np.flatnonzero(np.abs(stamps_us - middle_us) > 500 * plan.size))
    update_index_maps(file)


def lost_rows(stream: str) -> Plant:
    """So many rows in sequence are lost, with their stamps."""

    def plant(file: h5py.File, plan: Plan) -> None:
        total = len(file[TIMESTAMPS_OF[stream]])
        first = max(1, round(plan.begin * (total - plan.size - 1)))
        kept = np.r_[0:first, first + int(plan.size) : total]
        keep_rows(file, stream, kept)
        update_index_maps(file)

    return plant


def frames_lost_and_renumbered(file: h5py.File, plan: Plan) -> None:
    """Colour frames are lost, and what follows is stamped with the number of the frame times the period."""
    stamps_us = file["path/rgb_ts"][...]
    total, lost = len(stamps_us), int(plan.size)
    first = max(1, round(plan.begin * (total - lost - 1)))
    keep_rows(file, "rgb", np.r_[0:first, first + lost : total])
    _restamp(file, "rgb", stamps_us[: total - lost])
    update_index_maps(file)


def doubled_rows(stream: str) -> Plant:
    """Rows of a while are written twice, each beside its twin."""

    def plant(file: h5py.File, plan: Plan) -> None:
        total = len(file[TIMESTAMPS_OF[stream]])
        repeats = np.ones(total, dtype=np.int64)
        repeats[plan.rows(total)] = 2
        keep_rows(file, stream, np.repeat(np.arange(total), repeats))
        update_index_maps(file)

    return plant


def buffers_exchanged(stream: str) -> Plant:
    """The second half of a while is written before its first."""

    def plant(file: h5py.File, plan: Plan) -> None:
        total = len(file[TIMESTAMPS_OF[stream]])
        rows = plan.rows(total)
        middle = (rows.start + rows.stop) // 2
        keep_rows(file, stream, np.r_[0 : rows.start, middle : rows.stop, rows.start : middle, rows.stop : total])

    return plant


def cut(stream: str) -> Plant:
    """The last percent of a stream are absent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        stamps_us = file[TIMESTAMPS_OF[stream]][...]
        last_us = stamps_us[-1] - plan.size / 100 * (stamps_us[-1] - stamps_us[0])
        keep_rows(file, stream, np.flatnonzero(stamps_us <= last_us))
        update_index_maps(file)

    return plant


def from_donor(stream: str) -> Plant:
    """Rows of the plan's time hold what another sequence has there, under their own stamps."""

    def plant(file: h5py.File, plan: Plan) -> None:
        with h5py.File(plan.donor) as donor:
            for name in _streams(stream):
                rows = plan.rows(len(file[TIMESTAMPS_OF[name]]))
                for key in present_keys(file):
                    if key.startswith(f"path/{name}") and key != TIMESTAMPS_OF[name] and not key.endswith("_ts"):
                        values = file[key][...]
                        values[rows] = donor[key][...][rows]
                        replace_values(file, key, values)

    return plant


def events_of_donor(file: h5py.File, plan: Plan) -> None:
    """All events are those of another sequence."""
    with h5py.File(plan.donor) as donor:
        for name in "xytp":
            replace_values(file, f"path/events/{name}", donor[f"path/events/{name}"][...])
    update_index_maps(file)


def frozen(*keys: str) -> Plant:
    """So many rows in sequence repeat the row before them, under stamps of their own."""

    def plant(file: h5py.File, plan: Plan) -> None:
        total, count = len(file[keys[0]]), int(plan.size)
        first = 1 + round(plan.begin * (total - count - 2))
        for key in keys:
            values = file[key][...]
            values[first : first + count] = values[first - 1]
            replace_values(file, key, values)

    return plant


def neighbours_exchanged(key: str) -> Plant:
    """So many pairs of neighbouring frames are exchanged, anywhere within the plan's rows."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        rows = plan.rows(len(values) - 1)
        pairs = np.arange(rows.start, max(rows.stop - 1, rows.start + 1), 3)
        for row in plan.random.permutation(pairs)[: int(plan.size)]:
            values[[row, row + 1]] = values[[row + 1, row]]
        replace_values(file, key, values)

    return plant


def one_late(key: str) -> Plant:
    """Each row holds what belongs to the row before it."""

    def plant(file: h5py.File, plan: Plan) -> None:
        values = file[key][...]
        values[1:] = values[:-1].copy()
        replace_values(file, key, values)

    return plant
