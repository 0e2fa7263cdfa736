"""A corpus: what the manifest says is what lies there, the same each time, whole or without a manifest."""

import errno
import itertools
import json
import os
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest
from click.testing import CliRunner, Result

from fedora_generator import resources
from fedora_generator.commands import corpus as corpus_command
from fedora_generator.corpus import CorpusOptions, PlannedFile, build, plan_corpus
from fedora_generator.corpus.ladders import STEP, ladder_of
from fedora_generator.corpus.manifest import MANIFEST, PROGRESS, digest_of
from fedora_generator.errors import GeneratorError
from fedora_generator.faults import BYTE_FAULTS, FAULTS, allows_region, plant_fault
from fedora_generator.faults.fault import default_unit
from fedora_generator.partial_file import PartialFile
from fedora_generator.scene import Scene, load_scene
from tests.generator.tiny_sequence import HEIGHT, WIDTH, declare_noise, write_tiny_sequence

SIZE = ("--size", f"{WIDTH}x{HEIGHT}", "--duration", "0.4")
FEW = ("--causes", "gyro_bias,events:mirrored,time_offset,index_off_by_one,noise_misdeclared,pose:other_sequence")

STUDY_SIZE = (180, 136)

Corpus = Callable[..., Result]


@pytest.fixture
def corpus(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Corpus:
    """The command, with a generator that is quick: a tiny sequence that differs by scene and seed."""
    ready = tmp_path_factory.mktemp("ready")
    for name in ("park-day", "park-noisy", "fast-turn"):
        write_tiny_sequence(ready / f"{name}.h5")
    declare_noise(ready / "park-noisy.h5")

    def generate(scene: Scene, target: Path, *_: object, **__: object) -> None:
        shutil.copyfile(ready / f"{scene.name}.h5", target)
        with h5py.File(target, "r+") as file:
            file.attrs["seed"] = scene.seed
            file["path/pose/position"][...] += scene.seed + 10 * len(scene.name)

    monkeypatch.setattr(build, "generate_sequence", generate)
    # Tiny sequences have another sensor than a camera of their size, whose middle quarter would miss it.
    monkeypatch.setattr("fedora_generator.corpus.plan.event_camera", lambda camera: camera)

    def run(folder: Path, *arguments: str) -> Result:
        command = ["-o", str(folder), "--scenes", "park-day,park-noisy,fast-turn", *SIZE, *arguments]
        return CliRunner().invoke(corpus_command, command)

    return run


def manifest(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / MANIFEST).read_text())
    return content


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def interrupted_after(planted: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Ctrl-C come in the middle of planting, after so many faults."""
    left = [planted]

    def plant(source: Path, target: Path, *arguments: Any, **more: Any) -> Any:
        if left[0] == 0:
            raise KeyboardInterrupt
        left[0] -= 1
        return plant_fault(source, target, *arguments, **more)

    monkeypatch.setattr(build, "plant_fault", plant)


def test_the_manifest_lists_what_lies_there(corpus: Corpus, tmp_path: Path) -> None:
    """Every item's file exists with its digest and size, nothing else lies there, and nothing was skipped."""
    folder = tmp_path / "corpus"
    assert corpus(folder, *FEW).exit_code == 0
    content = manifest(folder)
    items = {item["file"]: item for item in content["items"]}
    assert files(folder) == {*items, MANIFEST}
    assert content["skipped"] == []
    for name, item in items.items():
        assert (digest_of(folder / name), (folder / name).stat().st_size) == (item["sha256"], item["bytes"])
        assert (item["cause"] is None) == (item["base"] is None) == (item["faults"] == [])
        assert item["base"] is None or items[item["base"]]["sha256"] != item["sha256"]
    assert {name.split("/")[0] for name in items} == {"clean", "single", "local", "composite"}


def test_the_same_arguments_give_the_same_bytes(corpus: Corpus, tmp_path: Path) -> None:
    """Two folders hold the same manifest, byte for byte; another seed gives another."""
    arguments = ("--causes", "gyro_bias,hot_pixels", "--clean", "1")
    texts = []
    for number, seed in enumerate(("0", "0", "1")):
        assert corpus(tmp_path / str(number), *arguments, "--seed", seed).exit_code == 0
        texts.append((tmp_path / str(number) / MANIFEST).read_bytes())
    assert texts[0] == texts[1] != texts[2]


def test_several_processes_write_the_same_bytes(corpus: Corpus, tmp_path: Path) -> None:
    """Faults that two processes plant give the manifest of one process, byte for byte, also where one is skipped."""
    arguments = ("--causes", "gyro_bias,pose:other_sequence", "--scenes", "park-day", "--clean", "1", "--ladder", "1")
    assert corpus(tmp_path, *arguments).exit_code == 0
    whole = (tmp_path / MANIFEST).read_bytes()
    for item in manifest(tmp_path)["items"]:
        if item["base"] is not None:
            (tmp_path / item["file"]).unlink()
    assert corpus(tmp_path, *arguments, "--jobs", "2").exit_code == 0
    assert manifest(tmp_path)["skipped"]
    assert (tmp_path / MANIFEST).read_bytes() == whole


def test_a_composite_is_both_faults_one_after_the_other(corpus: Corpus, tmp_path: Path) -> None:
    """The file is, byte for byte, the second fault planted in a file with the first."""
    assert corpus(tmp_path / "c", "--causes", "events:time_offset,gyro_bias", "--clean", "1").exit_code == 0
    (item,) = (item for item in manifest(tmp_path / "c")["items"] if item["file"].startswith("composite/"))
    first, second = item["faults"]
    assert (first["stream"], second["stream"]) == ("events", "imu")
    source = tmp_path / "c" / item["base"]
    for number, fault in enumerate((first, second)):
        target = tmp_path / f"{number}.h5"
        plant_fault(source, target, fault["cause"], fault["stream"], fault["magnitude"], fault["unit"], fault["seed"])
        source = target
    assert digest_of(source) == item["sha256"]


def test_an_interrupt_leaves_whole_files_and_the_next_run_goes_on(
    corpus: Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No manifest and nothing half made; again, files that were made are kept, damaged ones made anew."""
    arguments = ("--causes", "gyro_bias,accel_bias", "--clean", "1")
    assert corpus(tmp_path / "whole", *arguments).exit_code == 0
    with monkeypatch.context() as patch:
        interrupted_after(3, patch)
        assert corpus(tmp_path / "cut", *arguments).exit_code != 0
    left = files(tmp_path / "cut")
    assert PROGRESS in left
    assert left - {PROGRESS} < files(tmp_path / "whole") - {MANIFEST}
    kept = sorted(left - {PROGRESS})
    (tmp_path / "cut" / kept[0]).write_bytes(b"damaged")
    times = {name: (tmp_path / "cut" / name).stat().st_mtime_ns for name in kept}
    assert corpus(tmp_path / "cut", *arguments).exit_code == 0
    again = {name: (tmp_path / "cut" / name).stat().st_mtime_ns for name in kept}
    assert [name for name in kept if times[name] != again[name]] == kept[:1]
    assert (tmp_path / "cut" / MANIFEST).read_bytes() == (tmp_path / "whole" / MANIFEST).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--causes", "gyro_bais"), "choose from time_offset"),
        (("--causes", "gyro_bais"), "did you mean 'gyro_bias'?"),
        (("--scenes", "nowhere"), "Expected one of the scenes"),
        (("--duration", "-1"), "duration above 0"),
    ],
)
def test_refused_input_leaves_nothing(corpus: Corpus, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    """An unknown cause or scene, or an impossible duration, is said before a folder is made."""
    result = corpus(tmp_path / "corpus", *arguments)
    assert isinstance(result.exception, GeneratorError)
    assert message in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_too_little_disk_is_refused_before_any_work(
    corpus: Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With 1 kB free nothing is begun."""
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(resources.shutil, "disk_usage", lambda _: usage._replace(free=1_000))
    result = corpus(tmp_path / "corpus")
    assert "free for the corpus" in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_ends_the_work(corpus: Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No space left while a fault is planted: said as such, no manifest, no file that is not whole."""
    move_to, left = PartialFile.move_to, [2]

    def move_while_there_is_space(file: PartialFile, target: Path) -> None:
        left[0] -= 1
        if left[0] < 0:
            file.failure = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        move_to(file, target)

    monkeypatch.setattr(PartialFile, "move_to", move_while_there_is_space)
    result = corpus(tmp_path, "--causes", "gyro_bias", "--clean", "1")
    assert "full disk" in str(result.exception)
    assert sum(name.startswith("single/") for name in files(tmp_path)) < 3
    assert not any(name.endswith((MANIFEST, ".partial")) for name in files(tmp_path))


def test_other_files_are_kept_unless_forced(corpus: Corpus, tmp_path: Path) -> None:
    """A folder with a stranger's file, or a corpus of another duration, needs --force; the file stays even then."""
    (tmp_path / "mine.txt").write_text("mine")
    arguments = ("--causes", "gyro_bias", "--clean", "1", "--ladder", "1")
    assert "Expected an empty folder" in str(corpus(tmp_path, *arguments).exception)
    assert files(tmp_path) == {"mine.txt"}
    assert corpus(tmp_path, *arguments, "--force").exit_code == 0
    assert "another" not in (tmp_path / "mine.txt").read_text()
    before = (tmp_path / MANIFEST).read_bytes()
    assert "a corpus of other scenes" in str(corpus(tmp_path, *arguments, "--duration", "0.3").exception)
    assert (tmp_path / MANIFEST).read_bytes() == before


def test_a_dry_run_counts_and_makes_nothing(corpus: Corpus, tmp_path: Path) -> None:
    """The table adds up to the plan, and there is no folder."""
    result = corpus(tmp_path / "corpus", "--dry-run", *FEW)
    rows = {line.split()[0]: int(line.split()[1]) for line in result.stdout.splitlines()[1:]}
    assert rows.pop("all") == sum(rows.values()) > 20
    assert set(rows) == {"clean", "single", "local", "composite"}
    assert list(tmp_path.iterdir()) == []


def test_every_fault_of_the_table_is_planned() -> None:
    """Nothing is left out; names are unique; a ladder rises by its step; local faults lie within the middle."""
    scenes = tuple(load_scene(name).with_size(270, 200) for name in ("park-day", "park-noisy"))
    plan = plan_corpus(CorpusOptions(ladder=5), scenes)
    single = {(f.faults[0].cause, f.faults[0].stream) for f in plan if f.file.startswith("single/")}
    assert single == {*FAULTS, *BYTE_FAULTS}
    assert len({planned.file for planned in plan}) == len(plan)
    assert all(planned.base in {f.file for f in plan} for planned in plan if planned.faults)
    regions = {(f.faults[0].cause, f.faults[0].stream): f.faults[0].region for f in plan if f.faults[0:1]}
    local = [f for f in plan if f.file.endswith("h5") and "-quarter-" in f.file]
    assert {(f.faults[0].cause, f.faults[0].stream) for f in local} == {p for p in regions if allows_region(*p)}
    assert {f.faults[0].region for f in local if f.faults[0].stream != "events"} == {(67, 50, 202, 150)}


def test_every_fault_with_a_size_has_a_ladder() -> None:
    """Without a nominal size the fault would be refused when the corpus is made, after hours at worst."""
    assert [pair for pair in (*FAULTS, *BYTE_FAULTS) if default_unit(*pair) and ladder_of(*pair).nominal is None] == []


def test_ladders_are_geometric_around_their_nominal_size() -> None:
    """Five rungs of a bias span a factor of 81; counts are whole; a pose rate is worse as it falls."""
    rungs = [rung for rung in ladder_of("gyro_bias", "imu").rungs(5) if rung is not None]
    assert rungs[2] == ladder_of("gyro_bias", "imu").nominal
    assert rungs[4] / rungs[0] == pytest.approx(STEP**4, rel=0.01)
    assert ladder_of("dropped_samples", "imu").rungs(5) == (1.0, 3.0, 9.0)
    assert ladder_of("interpolated_pose", "pose").rungs(3) == (100.0, 50.0, 16.7)
    assert ladder_of("quaternion_order", "pose").rungs(5) == (None,)
    noisy = ladder_of("gyro_bias", "imu", noisy_pose=True).rungs(1)[0]
    assert noisy is not None
    assert noisy > rungs[4]
    assert not ladder_of("gyro_bias", "imu").is_observable(rungs[1])
    assert ladder_of("interpolated_pose", "pose").is_observable(16.7)
    assert [ladder_of("gyro_bias", "imu").is_observable(rungs[2], share) for share in (1, 1 / 4)] == [True, False]
    assert ladder_of("gyro_bias", "imu").is_observable(rungs[3], 1 / 4)


def test_a_map_that_is_left_out_is_legal() -> None:
    """Nothing declares an index map: its absence is no fault to be seen, as that of a declared stream is."""
    assert not ladder_of("missing_stream", "rgb_to_event").is_observable(None)
    assert ladder_of("missing_stream", "imu").is_observable(None)


def test_a_mounting_is_not_seen_under_noise_of_the_pose() -> None:
    """Each field may turn and shift as two noisy poses do, which is more than a wrong mounting makes of a second."""
    rolled, noisily = (
        ladder_of("extrinsic_rotation", "metadata"),
        ladder_of("extrinsic_rotation", "metadata", noisy_pose=True),
    )
    assert [rolled.is_observable(30.0), noisily.is_observable(30.0)] == [True, False]


def test_the_file_of_a_fault_does_not_hang_on_the_others() -> None:
    """Asked for alone, a fault gets the same file, base and seed as among all."""
    scenes = tuple(load_scene(name) for name in ("park-day", "park-noisy"))
    alone = plan_corpus(CorpusOptions(causes=("imu:time_offset",)), scenes)
    everything: set[PlannedFile] = set(plan_corpus(CorpusOptions(), scenes))
    assert {*alone} <= everything
    assert {replace(planned, faults=()) for planned in alone if planned.faults}


def test_what_a_killed_run_left_between_two_faults_is_removed(corpus: Corpus, tmp_path: Path) -> None:
    """The next run goes on, and its folder holds nothing that is hidden."""
    assert corpus(tmp_path, "--causes", "gyro_bias", "--clean", "1").exit_code == 0
    left = tmp_path / "single" / ".between-killed"
    left.mkdir()
    (left / "0.h5").write_bytes(b"half a file")
    assert corpus(tmp_path, "--causes", "gyro_bias", "--clean", "1").exit_code == 0
    assert not list(tmp_path.rglob(".*"))


def test_trials_cover_the_range_in_sequences_of_their_own() -> None:
    """Twelve trials span nine times the nominal size either way, evenly, each in another sequence of its own start."""
    scenes = tuple(load_scene(name).with_size(*STUDY_SIZE) for name in ("park-day", "racetrack"))
    options = CorpusOptions(clean=6, causes=("flow_gain",), trials=12, spread=True)
    plan = plan_corpus(options, scenes)
    trials = [one for one in plan if one.file.startswith("single/")]
    sizes = sorted(magnitude for one in trials if (magnitude := one.faults[0].magnitude) is not None)
    nominal = ladder_of("flow_gain", "flow").nominal
    assert nominal is not None
    assert len({one.base for one in trials}) == len(trials) == 12
    assert nominal / 9 <= sizes[0] < sizes[-1] <= 9 * nominal
    steps = [after / before for before, after in itertools.pairwise(sizes)]
    assert max(steps) < 81 ** (2 / 12)
    starts = {one.file: one.start_s for one in plan if one.base is None}
    assert len({*starts.values()}) == 6
    assert all(one.start_s == starts[one.base] for one in trials if one.base)


def test_more_trials_keep_those_before() -> None:
    """A corpus that grows keeps its files; deep causes get more trials, faults of one size a fourth."""
    scenes = (load_scene("park-day").with_size(*STUDY_SIZE),)
    causes = ("flow_gain", "imu:gyro_bias", "polarity_inverted")
    few = CorpusOptions(clean=80, causes=causes, trials=8, deep=("gyro_bias",), deep_trials=16)
    plans = [plan_corpus(replace(few, trials=trials), scenes) for trials in (8, 12)]
    assert {*plans[0]} < {*plans[1]}
    counts = Counter(one.faults[0].cause for one in plans[0] if one.file.startswith("single/"))
    assert counts == {"flow_gain": 8, "gyro_bias": 16, "polarity_inverted": 2}


def test_what_pose_noise_hides_is_tried_without_it() -> None:
    """One curve could not hold sizes that differ by orders of magnitude; other faults are tried in every scene."""
    scenes = tuple(load_scene(name).with_size(*STUDY_SIZE) for name in ("park-day", "park-noisy"))
    plan = plan_corpus(CorpusOptions(clean=4, causes=("imu:gyro_bias", "hot_pixels"), trials=8), scenes)
    of_cause = {
        cause: {one.scene for one in plan if "trial" in one.file and one.faults[0].cause == cause}
        for cause in ("gyro_bias", "hot_pixels")
    }
    assert of_cause == {"gyro_bias": {"park-day"}, "hot_pixels": {"park-day", "park-noisy"}}


def test_without_trials_nothing_is_said_of_starts(corpus: Corpus, tmp_path: Path) -> None:
    """A corpus of ladders has the manifest that it always had; spread, each sequence begins elsewhere."""
    arguments = ("--causes", "gyro_bias", "--clean", "2")
    assert corpus(tmp_path / "ladders", *arguments).exit_code == 0
    assert all("start_s" not in item for item in manifest(tmp_path / "ladders")["items"])
    assert corpus(tmp_path / "spread", *arguments, "--spread").exit_code == 0
    items = manifest(tmp_path / "spread")["items"]
    assert len({item["start_s"] for item in items if item["scene"] == "park-day"}) == 2
    assert corpus(tmp_path / "none", "--deep", "gyro_bias").exit_code == 2


def test_trials_off_the_grid_are_drawn_at_random() -> None:
    """Sizes lie on no grid, shifts of colour go anywhere by parts of a pixel, and local faults anywhere in the file."""
    scenes = (load_scene("park-day").with_size(*STUDY_SIZE),)
    causes = ("rgb:spatial_offset", "events:spatial_offset", "imu:gyro_bias", "pose:teleport")
    plan = plan_corpus(CorpusOptions(clean=12, causes=causes, trials=12, off_grid=True), scenes)
    of_pair: dict[tuple[str, str], list[PlannedFile]] = {}
    for planned in plan:
        for fault in planned.faults:
            of_pair.setdefault((fault.stream, fault.cause), []).append(planned)
    shifts = [one.faults[0] for one in of_pair["rgb", "spatial_offset"] if one.file.startswith("single/")]
    assert len({fault.magnitude for fault in shifts}) == len({fault.direction_deg for fault in shifts}) == 12
    assert all(1 / 9 <= (fault.magnitude or 0.0) <= 9 for fault in shifts)
    assert any((fault.magnitude or 1.0) % 1 for fault in shifts)
    for one in of_pair["events", "spatial_offset"]:
        assert one.faults[0].direction_deg is None
        assert (one.faults[0].magnitude or 0.5) % 1 == 0
    intervals = [one.faults[0] for one in of_pair["imu", "gyro_bias"] if one.file.startswith("local/")]
    assert len({(fault.start_s, fault.stop_s) for fault in intervals}) == len(intervals) == 3
    assert all(0 <= (fault.start_s or 0.0) < (fault.stop_s or 0.0) <= 1 for fault in intervals)
    jumps = [one.faults[0] for one in of_pair["pose", "teleport"] if one.file.startswith("local/")]
    assert all(fault.start_s is not None and fault.stop_s is None for fault in jumps)
    regions = [one.faults[0].region for one in of_pair["rgb", "spatial_offset"] if one.faults[0].region]
    assert len({*regions}) == 3
    assert all(0 <= left < right <= STUDY_SIZE[0] * 4 and 0 <= top < bottom for left, top, right, bottom in regions)


def test_off_the_grid_more_trials_keep_those_before() -> None:
    """A corpus that grows keeps its files, and a corpus on the grid has no trace of the option."""
    scenes = (load_scene("park-day").with_size(*STUDY_SIZE),)
    few = CorpusOptions(clean=20, causes=("flow_gain", "rgb:spatial_offset"), trials=8, off_grid=True)
    assert {*plan_corpus(few, scenes)} < {*plan_corpus(replace(few, trials=16), scenes)}
    on_grid = plan_corpus(replace(few, off_grid=False), scenes)
    assert all(fault.direction_deg is None for one in on_grid for fault in one.faults)
    assert not {one.file for one in plan_corpus(few, scenes) if one.faults} & {one.file for one in on_grid}


def test_a_manifest_off_the_grid_states_directions(corpus: Corpus, tmp_path: Path) -> None:
    """Only shifts off the grid have a direction; without trials there is nothing to draw."""
    arguments = ("--causes", "rgb:spatial_offset,gyro_bias", "--trials", "4", "--clean", "2")
    assert corpus(tmp_path / "off", *arguments, "--off-grid").exit_code == 0
    faults = [fault for item in manifest(tmp_path / "off")["items"] for fault in item["faults"]]
    assert {fault["cause"] for fault in faults if "direction_deg" in fault} == {"spatial_offset"}
    assert corpus(tmp_path / "on", *arguments).exit_code == 0
    assert "direction_deg" not in (tmp_path / "on" / MANIFEST).read_text()
    assert "--trials with --off-grid" in corpus(tmp_path / "none", "--off-grid").output
