"""Memory: the estimate holds, the machine's word is read, and the length of a sequence does not matter."""

import resource
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator import resources
from fedora_generator.errors import OutputError, SceneError
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.layout.create import create_dataset

ALL = frozenset({"rgb", "depth", "events", "flow", "imu", "pose"})

MEASURE = """
import sys
from pathlib import Path
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.resources import peak_bytes
from fedora_generator.scene import load_scene

def most_bytes():
    # Not the maximum of getrusage, which a process inherits from the one that starts it.
    return 1024 * int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])

name, width, height, streams, *durations_s = sys.argv[2:]
scene, names = load_scene(name).with_size(int(width), int(height)), frozenset(streams.split(","))
before = most_bytes()
print(peak_bytes(scene, names))
for duration_s in durations_s:
    request = Request(duration_s=float(duration_s), quality="draft", streams=names)
    generate_sequence(scene, Path(sys.argv[1]) / "a.h5", request, overwrite=True)
    print(most_bytes() - before)
"""


def measured(folder: Path, name: str, size: tuple[int, int], streams: str, *durations_s: float) -> list[float]:
    """The estimate, and bytes that one process has taken at most after each sequence beyond what was there before."""
    command = [sys.executable, "-c", MEASURE, str(folder), name, *map(str, size), streams, *map(str, durations_s)]
    return [float(each) for each in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()]


def test_the_estimate_is_above_what_is_taken(tmp_path: Path) -> None:
    """For large images, where it matters, by no more than the half of a GB of them."""
    estimate, taken = measured(tmp_path, "park-noisy", (1800, 1350), ",".join(ALL), 0.01)
    assert taken < estimate < taken + 0.5e9


def test_memory_does_not_grow_with_the_length(tmp_path: Path) -> None:
    """Four times the sequence takes what the sequence has taken, but for the allocator's whims, 3 MB.

    What the file holds more, before it is compressed, are 9 MB. The first sequence of a process does not count: another
    one of the same length takes 2 MB more.
    """
    _, first, short, long = measured(tmp_path, "park-day", (90, 68), ",".join(ALL), 0.5, 0.5, 2)
    assert first > 0
    assert long < max(first, short) + 3e6


def test_inertial_samples_are_written_in_pieces(tmp_path: Path) -> None:
    """Five minutes of samples and poses, which are 100 MB as states of the flight, take two thirds of it."""
    _, taken = measured(tmp_path, "hover", (90, 68), "imu,pose", 300)
    assert taken < 70e6


def test_what_does_not_fit_is_refused_with_a_size_that_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """The size that is named fits, and is the largest to do so; all numbers are in the message."""
    monkeypatch.setattr(resources, "available_bytes", lambda: 400e6)
    scene = load_scene("park-day").with_size(4000, 3000)
    with pytest.raises(SceneError, match=r"most 400 MB .* got 4000x3000 of depth, .* about 1\d{3} MB; use") as refused:
        resources.require_memory(scene, ALL)
    width, height = map(int, str(refused.value).split("--size ")[1].split(",")[0].split("x"))
    resources.require_memory(scene.with_size(width, height), ALL)
    with pytest.raises(SceneError):
        resources.require_memory(scene.with_size(width + 8, height + 6), ALL)
    resources.require_memory(scene, frozenset({"imu", "pose"}))


def test_no_size_is_named_where_none_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Next to no memory is not the fault of the size, nor of the rates of events."""
    monkeypatch.setattr(resources, "available_bytes", lambda: 50e6)
    with pytest.raises(SceneError, match="free some, or raise its limit"):
        resources.require_memory(load_scene("park-day"), ALL)


@pytest.mark.parametrize("streams", [frozenset({each}) for each in sorted(ALL)], ids=sorted(ALL))
def test_fewer_streams_never_take_more(streams: frozenset[str]) -> None:
    """Whatever is left out."""
    for name in ("park-noisy", "park-mesh-day"):
        assert resources.peak_bytes(load_scene(name), streams) <= resources.peak_bytes(load_scene(name), ALL)


def test_a_limit_of_the_address_space_counts() -> None:
    """As ``ulimit -v`` sets it: what is left of it is what there is."""
    code = (
        "import resource; from fedora_generator.resources import available_bytes\n"
        "from pathlib import Path\n"
        "used = 1024 * int(Path('/proc/self/status').read_text().split('VmSize:')[1].split()[0])\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 50_000_000, resource.RLIM_INFINITY))\n"
        "assert 40e6 < available_bytes() <= 50e6, available_bytes()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY


@pytest.mark.parametrize(
    ("membership", "files", "expected"),
    [
        ("0::/a", {"a/memory.max": "1000", "a/memory.current": "400", "a/memory.stat": "inactive_file 150"}, 750),
        ("0::/job", {"job/memory.max": "max", "job/memory.current": "400"}, None),
        ("0::/a/b", {"a/b/memory.max": "900", "a/memory.max": "500", "a/memory.current": "100"}, 400),
        ("0::/elsewhere", {"memory.max": "700", "memory.current": "200"}, 500),
        (
            "4:memory:/job\n1:cpu:/job",
            {"memory/job/memory.limit_in_bytes": "1000", "memory/job/memory.usage_in_bytes": "300"},
            700,
        ),
        ("", {}, None),
    ],
)  # fmt: skip
def test_the_limit_of_a_cgroup_counts(
    tmp_path: Path, membership: str, files: dict[str, str], expected: float | None
) -> None:
    """Of either version, of whichever group above; page cache can be dropped."""
    (tmp_path / "membership").write_text(membership)
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    assert min(resources.of_the_cgroups(tmp_path, tmp_path / "membership"), default=None) == expected


IMAGES = frozenset({"rgb", "depth", "flow"})


@pytest.mark.parametrize("size", [(72, 54), (1440, 1080)])
def test_the_least_is_less_than_blank_images_take(tmp_path: Path, size: tuple[int, int]) -> None:
    """Frames of one colour without any depth, which compress best; a fiftieth of a second of each stream."""
    width, height = size
    sizes = {"H": height, "W": width, "H_rgb": height, "W_rgb": width, "N": 1, "D": 1, "K10": 1, "K25": 1, "K50": 1}
    rates_hz = {"path/rgb": 50, "path/depth": 50, "path/flow/10hz": 10, "path/flow/25hz": 25, "path/flow/50hz": 50}
    with h5py.File(tmp_path / "blank.h5", "w") as file:
        a_second = 0.0
        for key, rate_hz in rates_hz.items():
            dataset = create_dataset(file, key, sizes)
            dataset[0] = 7 if key == "path/rgb" else np.nan
            a_second += rate_hz * dataset.id.get_storage_size()
    scene = load_scene("park-day").with_size(width, height)
    assert 0 < resources.least_bytes(scene, 1_000_000, IMAGES) < a_second


def test_streams_left_out_need_no_room() -> None:
    """Each is a share of the whole; what is not made of images needs next to nothing."""
    scene = load_scene("park-day")
    shares = [resources.expected_bytes(scene, 1.0, frozenset({name})) for name in ("rgb", "depth", "events", "flow")]
    assert sum(shares) == pytest.approx(resources.expected_bytes(scene, 1.0), abs=4)
    assert min(shares) > 0
    assert resources.expected_bytes(scene, 1.0, frozenset({"imu", "pose"})) == 0


def test_a_full_disk_is_refused_and_a_small_one_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing free: refused at once, whatever the streams; too little for what is likely: one line, and the work."""
    scene, warnings = load_scene("hover").with_size(72, 54), list[str]()
    usage = shutil.disk_usage(tmp_path)

    def generate(free_bytes: int, *streams: str) -> None:
        monkeypatch.setattr(resources.shutil, "disk_usage", lambda _: usage._replace(free=free_bytes))
        request = Request(duration_s=0.02, streams=frozenset(streams))
        generate_sequence(scene, tmp_path / "a.h5", request, overwrite=True, warn=warnings.append)

    with pytest.raises(OutputError, match=r"free for the sequence, got 0.00 MB at .*; make room"):
        generate(0, "imu")
    assert list(tmp_path.iterdir()) == []
    generate(8_000, "depth")
    assert len(warnings) == 1
    assert "are expected, and 0.01 MB are free" in warnings[0]
    generate(10**12, "depth")
    assert len(warnings) == 1
