"""How fast recordings are decoded and brought in, and in how much memory.

``python -m tests.benchmarks.importing`` prints the tables of docs/import.md. Decoding is the compiled loop alone, on
words in memory, by seconds of the thread. Importing is all of it, from a file to a file, in a process of its own that
does nothing else, with a thread for each core: its seconds at work, summed over threads, its seconds by the clock, and
its peak of memory. It is done four times, of which the first loads libraries and compiled loops and does not count; of
the others the quickest does. A second table has EVT3 at other levels of compression.
"""

import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer

from fedora_qa.importing.prophesee import DECODERS
from fedora_qa.importing.recording import BLOCK_BYTES
from tests.support.bags import Bag

HEADER: Final = "% evt {version}\n% format {name};height=720;width=1280\n% end\n"
DAT_HEADER: Final = "% Data file containing CD events\n% Version 2\n% Width 1280\n% Height 720\n"

CHILD: Final = """
import re, sys, time
from pathlib import Path
from fedora_qa.cli.host import usable_cores
from fedora_qa.importing.run import ImportOptions, import_recording
level = {"level": int(sys.argv[3])} if int(sys.argv[3]) else {}
options = ImportOptions(allow_backwards=True, threads=usable_cores(), **level)
work_s, clock_s = [], []
for _ in range(4):
    Path(sys.argv[2]).unlink(missing_ok=True)
    started = time.process_time(), time.perf_counter()
    done = import_recording(Path(sys.argv[1]), Path(sys.argv[2]), options, lambda *_: None)
    work_s.append(time.process_time() - started[0])
    clock_s.append(time.perf_counter() - started[1])
# Not `ru_maxrss`, which a process inherits from the one that starts it.
peak_kb = re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]
print(sum(done.rows.values()), min(work_s[1:]), min(clock_s[1:]), int(peak_kb) / 1024)
"""


def evt3_words(rows: int, rng: np.random.Generator, *, vectors: bool) -> NDArray[np.uint16]:
    """Rows of events, 20 us apart: three vectors of 12, 12 and 8 with every second bit set, or four single events."""
    number = np.arange(rows)
    times_us = 20 * number
    parts = [0x8000 | (times_us >> 12) % 4096, 0x6000 | times_us % 4096, number % 720]
    base = rng.integers(0, 1200, rows)
    if vectors:
        parts += [0x3000 | rng.integers(0, 2, rows) << 11 | base]
        parts += [0x4000 | rng.integers(0, 4096, rows), 0x4000 | rng.integers(0, 4096, rows)]
        parts += [0x5000 | rng.integers(0, 256, rows)]
    else:
        parts += [0x2000 | rng.integers(0, 2, rows) << 11 | (base + k) for k in range(4)]
    return np.stack(parts, axis=1).reshape(-1).astype("<u2")


def scattered_evt3_words(events: int, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Single events of pixels that have nothing to do with each other, one a microsecond, each in a row of its own."""
    number = np.arange(events)
    parts = [0x8000 | (number >> 12) % 4096, 0x6000 | number % 4096, rng.integers(0, 720, events)]
    parts += [0x2000 | rng.integers(0, 2, events) << 11 | rng.integers(0, 1280, events)]
    return np.stack(parts, axis=1).reshape(-1).astype("<u2")


def evt2_words(rows: int, rng: np.random.Generator) -> NDArray[np.uint32]:
    """A word of time and seven events every 64 us."""
    words = rng.integers(0, 1 << 29, (rows, 8)).astype("<u4")
    words[:, 1:] = np.sort(words[:, 1:] & 0x0FFFFFFF, axis=1) | (words[:, 1:] & 0x10000000)
    words[:, 0] = 0x80000000 | np.arange(rows)
    return words.reshape(-1)


def dat_words(events: int, rng: np.random.Generator) -> NDArray[np.uint64]:
    """An event a microsecond."""
    place = rng.integers(0, 1280, events) | rng.integers(0, 720, events) << 14 | rng.integers(0, 2, events) << 28
    return (place.astype("<u8") << np.uint64(32)) | np.arange(events).astype("<u8")


def decoded(name: str, words: NDArray[np.unsignedinteger]) -> tuple[int, float]:
    """Return the number of events, and the seconds of the thread."""
    decoder = DECODERS[name]
    length = BLOCK_BYTES // words.itemsize
    most = length * decoder.events_per_word
    columns = (np.empty(most, np.uint16), np.empty(most, np.uint16), np.empty(most, np.int64), np.empty(most, np.uint8))
    state = np.array(decoder.initial_state, np.int64)
    decoder.decode(words[:1], state.copy(), *columns)  # compiled before the clock starts
    started, events = time.thread_time(), 0
    for first in range(0, len(words), length):
        events += decoder.decode(words[first : first + length], state, *columns)
    return events, time.thread_time() - started


class Import(NamedTuple):
    """An import: rows, seconds at work and by the clock, MB of memory at the peak, and bytes of the output."""

    rows: int
    work_s: float
    clock_s: float
    memory_mb: float
    size: int

    @property
    def cells(self) -> str:
        """Cells of a table: rates by a core and by the clock, in millions of rows, memory, and bytes a row."""
        rates = (f"{self.rows / seconds / 1e6:.3g} M/s" for seconds in (self.work_s, self.clock_s))
        return f"{' | '.join(rates)} | {self.memory_mb:.0f} MB | {self.size / self.rows:.2f}"


def imported(name: str, words: NDArray[np.unsignedinteger], folder: Path, level: int = 0) -> Import:
    """Import words from a file."""
    source, target = folder / f"{name}.raw", folder / f"{name}.h5"
    header = DAT_HEADER + "\f\b" if name == "DAT" else HEADER.format(version=f"{name[-1]}.0", name=name)
    with source.open("wb") as file:
        file.write(header.encode())
        words.tofile(file)
    return in_a_process(source, target, level)


def in_a_process(source: Path, target: Path, level: int = 0) -> Import:
    """Import a recording, with a level of compression; 0: the usual one."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, source, target, str(level)], capture_output=True, text=True, check=True
    ).stdout.split()
    return Import(int(done[0]), float(done[1]), float(done[2]), float(done[3]), target.stat().st_size)


def event_bag(folder: Path, arrays: int, rng: np.random.Generator) -> Path:
    """A bag of ROS 1 with arrays of 10,000 events, 10 ms each."""
    bag, count = Bag("ros1"), 10_000
    packed = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
    with Writer(folder / "events.bag") as writer:
        connection = writer.add_connection("/dvs/events", "dvs_msgs/msg/EventArray", typestore=bag.store)
        for k in range(arrays):
            times_us = np.sort(rng.integers(0, 10_000, count)) + 10_000 * k
            events = np.zeros(count, packed)
            events["x"], events["y"], events["p"] = (rng.integers(0, most, count) for most in (640, 480, 2))
            events["s"], events["ns"] = times_us // 1_000_000, times_us % 1_000_000 * 1000
            head = struct.pack("<7I", k, 0, 0, 0, 480, 640, count)
            writer.write(connection, 10_000_000 * k, head + events.tobytes())
    return folder / "events.bag"


def imu_bag(folder: Path, samples: int) -> Path:
    """A bag of ROS 1 with a sample every millisecond."""
    bag = Bag("ros1")
    bag.add_imu(5, (0, 0, 0), (0, 0, 0))
    serialised = bytes(bag.store.serialize_ros1(bag.messages[0][3], "sensor_msgs/msg/Imu"))
    with Writer(folder / "imu.bag") as writer:
        connection = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=bag.store)
        for k in range(samples):
            head = struct.pack("<III", k, 1 + k // 1000, k % 1000 * 1_000_000)
            writer.write(connection, 1_000_000 * k, head + serialised[12:])
    return folder / "imu.bag"


def main() -> None:
    """Print a row for each encoding."""
    scale = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    rng = np.random.default_rng(0)
    works: dict[str, tuple[str, Callable[[], NDArray[np.unsignedinteger]]]] = {
        "EVT3, vectors": ("EVT3", lambda: evt3_words(scale * 100_000, rng, vectors=True)),
        "EVT3, single events": ("EVT3", lambda: evt3_words(scale * 300_000, rng, vectors=False)),
        "EVT3, scattered events": ("EVT3", lambda: scattered_evt3_words(scale * 1_000_000, rng)),
        "EVT2": ("EVT2", lambda: evt2_words(scale * 150_000, rng)),
        "DAT": ("DAT", lambda: dat_words(scale * 1_000_000, rng)),
    }
    print("| recording | events | decoding | import, a core | import, by the clock | peak of memory | bytes an event |")
    print("| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for title, (name, make) in works.items():
        words = make()
        events, decoding_s = decoded(name, words)
        with tempfile.TemporaryDirectory() as folder:
            cells = imported(name, words, Path(folder)).cells
        print(f"| {title} | {events / 1e6:.1f} M | {events / decoding_s / 1e6:.0f} M/s | {cells} |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        bags = {
            "ROS 1 bag, events": event_bag(Path(folder), 100 * scale, rng),
            "ROS 1 bag, IMU": imu_bag(Path(folder), 20_000 * scale),
        }
        for title, bag in bags.items():
            done = in_a_process(bag, Path(folder) / "out.h5")
            print(f"| {title} | {done.rows / 1e6:.2f} M | | {done.cells} |", flush=True)
    print("\n| recording | level | import, a core | import, by the clock | peak of memory | bytes an event |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)
    for title, (name, make) in list(works.items())[:3]:
        words = make()
        for level in (1, 2, 3, 5):
            with tempfile.TemporaryDirectory() as folder:
                print(f"| {title} | {level} | {imported(name, words, Path(folder), level).cells} |", flush=True)


if __name__ == "__main__":
    main()
