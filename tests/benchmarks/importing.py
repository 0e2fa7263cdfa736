"""How fast recordings are decoded and brought in, and in how much memory.

``python -m tests.benchmarks.importing`` prints the table of docs/import.md. Decoding is the compiled loop alone, on
words in memory, by seconds of the thread. Importing is all of it, from a file to a file, in a process of its own that
does nothing else: its seconds at work and its peak of memory. It is done twice, and the second time counts: the first
loads libraries and compiled loops. A second table has EVT3 at other levels of compression.
"""

import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

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
from fedora_qa.importing import sequence_writer
from fedora_qa.importing.run import ImportOptions, import_recording
sequence_writer._LEVEL = int(sys.argv[3]) or sequence_writer._LEVEL
for _ in range(2):
    Path(sys.argv[2]).unlink(missing_ok=True)
    started = time.process_time()
    done = import_recording(Path(sys.argv[1]), Path(sys.argv[2]), ImportOptions(allow_backwards=True), lambda *_: None)
    seconds = time.process_time() - started
# Not `ru_maxrss`, which a process inherits from the one that starts it.
peak_kb = re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]
print(sum(done.rows.values()), seconds, int(peak_kb) / 1024)
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


def imported(
    name: str, words: NDArray[np.unsignedinteger], folder: Path, level: int = 0
) -> tuple[int, float, float, int]:
    """Return events, seconds at work, MB of memory at the peak, and bytes of the output, of a process of its own."""
    source, target = folder / f"{name}.raw", folder / f"{name}.h5"
    header = DAT_HEADER + "\f\b" if name == "DAT" else HEADER.format(version=f"{name[-1]}.0", name=name)
    with source.open("wb") as file:
        file.write(header.encode())
        words.tofile(file)
    return in_a_process(source, target, level)


def in_a_process(source: Path, target: Path, level: int = 0) -> tuple[int, float, float, int]:
    """Return rows, seconds at work, MB of memory at the peak, and bytes of the output, of a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, source, target, str(level)], capture_output=True, text=True, check=True
    ).stdout.split()
    return int(done[0]), float(done[1]), float(done[2]), target.stat().st_size


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
        "EVT2": ("EVT2", lambda: evt2_words(scale * 150_000, rng)),
        "DAT": ("DAT", lambda: dat_words(scale * 1_000_000, rng)),
    }
    print("| recording | events | decoding | import | peak of memory | bytes an event in the file |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)
    for title, (name, make) in works.items():
        words = make()
        events, decoding_s = decoded(name, words)
        with tempfile.TemporaryDirectory() as folder:
            written, import_s, memory_mb, size = imported(name, words, Path(folder))
        rates = f"{events / decoding_s / 1e6:.0f} M/s | {written / import_s / 1e6:.1f} M/s"
        sizes = f"{memory_mb:.0f} MB | {size / events:.1f}"
        print(f"| {title} | {events / 1e6:.1f} M | {rates} | {sizes} |", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        bags = {
            "ROS 1 bag, events": event_bag(Path(folder), 100 * scale, rng),
            "ROS 1 bag, IMU": imu_bag(Path(folder), 20_000 * scale),
        }
        for title, bag in bags.items():
            rows, import_s, memory_mb, size = in_a_process(bag, Path(folder) / "out.h5")
            rates = f"| {rows / import_s / 1e6:.3f} M/s | {memory_mb:.0f} MB | {size / rows:.1f} |"
            print(f"| {title} | {rows / 1e6:.2f} M | | {rates.removeprefix('| ')}", flush=True)
    print("\n| recording | level | import | bytes an event in the file |")
    print("| --- | --- | --- | --- |", flush=True)
    for title in ("EVT3, vectors", "EVT3, single events"):
        name, make = works[title]
        words = make()
        for level in (1, 2, 3, 5):
            with tempfile.TemporaryDirectory() as folder:
                rows, import_s, _, size = imported(name, words, Path(folder), level)
            print(f"| {title} | {level} | {rows / import_s / 1e6:.1f} M/s | {size / rows:.2f} |", flush=True)


if __name__ == "__main__":
    main()
