"""Everything wrong with a layout is named, and nothing else."""

from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.causes import allowed
from fedora_qa.layout.canonical import DATASETS, STREAMS
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.resolve import Layout, resolve
from tests.support.handmade import write_handmade

Edit = Callable[[h5py.File], None]


@pytest.fixture
def file(tmp_path: Path) -> Iterator[h5py.File]:
    """The handmade file, open for changes."""
    with h5py.File(write_handmade(tmp_path / "hand.h5"), "r+") as opened:
        yield opened


def replace(file: h5py.File, key: str, values: np.ndarray) -> None:
    del file[key]
    file[key] = values


def only_problem(layout: Layout) -> tuple[str, str, str, str]:
    (problem,) = layout.problems
    assert allowed(problem.cause, problem.stream)
    return problem.code.removeprefix("integrity.layout."), problem.cause, problem.stream, problem.key


def test_handmade_file_is_whole(file: h5py.File) -> None:
    """A file written by hand from the format's text is found whole: reader and format agree."""
    layout = resolve(file)
    assert layout.dialect_name == "fedora"
    assert layout.streams == set(STREAMS)
    assert set(layout.bindings) == {key for key, spec in DATASETS.items() if not spec.optional}
    assert not layout.problems
    assert not layout.absent
    assert not layout.inferred


@pytest.mark.parametrize(
    ("key", "name", "stream"),
    [
        ("metadata/depth_to_event", "metadata/depth_to_eve(t", "depth_to_event"),
        ("metadata/rgb_to_event", "metadata/rgb_to_events", "rgb_to_event"),
        ("path/events", "path/event", "events"),
    ],
)
def test_misspelt_name_is_noted(file: h5py.File, key: str, name: str, stream: str) -> None:
    """A name that is nearly that of an absent stream is a note beside whatever else its absence is."""
    file.move(key, name)
    notes = [problem for problem in resolve(file).problems if problem.is_lossless]
    assert [(note.code, note.stream) for note in notes] == [("integrity.layout.similar_name", stream)]
    assert f"got {name}; rename it" in notes[0].message


def test_misspelt_stream_that_is_declared_is_missing(file: h5py.File) -> None:
    """The note takes nothing from the finding that a declared stream is missing."""
    file.move("path/events", "path/event")
    rules = {problem.code for problem in resolve(file).problems if problem.stream == "events"}
    assert rules == {"integrity.layout.missing_stream", "integrity.layout.similar_name"}


@pytest.mark.parametrize("name", ["metadata/depth_to_frame", "metadata/event_to_depth", "metadata/rgb_to_depth", "x"])
def test_other_names_are_not_noted(file: h5py.File, name: str) -> None:
    """Names of their own beside an absent map, and the names of the layout, are nobody's misspelling."""
    del file["metadata/depth_to_event"]
    file[name] = np.arange(3)
    assert not resolve(file).problems


def test_masks_of_what_moves_are_read_where_they_are(file: h5py.File) -> None:
    """They are bound beside their flow, and no stream of their own; one that does not fit is a problem of its flow."""
    flow = file["path/flow/10hz"]
    file["path/flow/10hz_moving"] = np.zeros(flow.shape[:3], np.uint8)
    layout = resolve(file)
    assert "path/flow/10hz_moving" in layout.bindings
    assert layout.streams == set(STREAMS)
    assert not layout.problems
    del file["path/flow/10hz_moving"]
    file["path/flow/10hz_moving"] = np.zeros((*flow.shape[:2], 7), np.uint8)
    assert only_problem(resolve(file)) == ("wrong_shape", "wrong_shape", "flow/10hz", "path/flow/10hz_moving")


def test_streams_may_be_left_out(file: h5py.File) -> None:
    """A stream that nothing declares is absent, with a reason, and not a problem."""
    del file["path/imu"], file["metadata/imu"], file["path/flow/25hz"], file["path/flow/25hz_ts"]
    layout = resolve(file)
    assert not layout.problems
    assert set(layout.absent) == {"imu", "flow/25hz"}
    assert layout.streams == set(STREAMS) - set(layout.absent)


@pytest.mark.parametrize("stream", ["rgb", "depth", "events", "imu", "pose"])
def test_declared_stream_is_promised(file: h5py.File, stream: str) -> None:
    """A stream that the metadata declare and that is not there is missing."""
    for key in (key for key, spec in DATASETS.items() if spec.stream == stream):
        del file[key]
    assert ("missing_stream", "missing_stream", stream, "") == only_problem(resolve(file))


def test_declared_flow_is_promised(file: h5py.File) -> None:
    """Declared flow without any rate is missing."""
    del file["path/flow"]
    assert only_problem(resolve(file)) == ("missing_stream", "missing_stream", "flow", "")


@pytest.mark.parametrize("key", [key for key, spec in DATASETS.items() if spec.is_timestamps])
def test_stream_without_timestamps_is_broken(file: h5py.File, key: str) -> None:
    """A stream whose stamps are missing cannot be used, and the missing dataset is named."""
    del file[key]
    layout = resolve(file)
    stream = DATASETS[key].stream
    assert only_problem(layout) == ("missing_stream", "missing_stream", stream, key)
    assert stream not in layout.streams
    assert not any(DATASETS[bound].stream == stream for bound in layout.bindings)


def narrow_orientation(file: h5py.File) -> None:
    replace(file, "path/pose/orientation", np.zeros((21, 3)))


def drop_channels(file: h5py.File) -> None:
    replace(file, "path/rgb", np.zeros((6, 27, 36), dtype=np.uint8))


def shorten_t(file: h5py.File) -> None:
    replace(file, "path/events/t", file["path/events/t"][:-1])


def flow_of_another_size(file: h5py.File) -> None:
    replace(file, "path/flow/50hz", np.zeros((5, 20, 36, 2), dtype=np.float32))


def group_for_dataset(file: h5py.File) -> None:
    del file["path/depth"]
    file.create_group("path/depth")


def empty_images(file: h5py.File) -> None:
    replace(file, "path/rgb", np.zeros((6, 0, 36, 3), dtype=np.uint8))


def scalar_timestamps(file: h5py.File) -> None:
    del file["path/imu/ts"]
    file["path/imu/ts"] = 7


def long_map(file: h5py.File) -> None:
    replace(file, "metadata/rgb_to_event", np.zeros(9, dtype=np.int64))


@pytest.mark.parametrize(
    ("edit", "stream", "key"),
    [
        (narrow_orientation, "pose", "path/pose/orientation"),
        (drop_channels, "rgb", "path/rgb"),
        (shorten_t, "events", "path/events/t"),
        (flow_of_another_size, "flow/50hz", "path/flow/50hz"),
        (group_for_dataset, "depth", "path/depth"),
        (empty_images, "rgb", "path/rgb"),
        (scalar_timestamps, "imu", "path/imu/ts"),
        (long_map, "rgb_to_event", "metadata/rgb_to_event"),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_wrong_shapes(file: h5py.File, edit: Edit, stream: str, key: str) -> None:
    """A shape that contradicts the layout or another dataset takes its stream away, and no other."""
    edit(file)
    layout = resolve(file)
    rule, cause, found_stream, found_key = only_problem(layout)
    assert (cause, found_stream, found_key) == ("wrong_shape", stream, key)
    assert rule in {"wrong_shape", "not_a_dataset"}
    assert set(STREAMS) - layout.streams == {stream}


def test_short_index_map_is_truncated(file: h5py.File) -> None:
    """A map with fewer entries than frames was cut off; the problem says by how much."""
    replace(file, "metadata/rgb_to_event", file["metadata/rgb_to_event"][:3])
    (problem,) = resolve(file).problems
    assert (problem.cause, problem.stream, problem.magnitude) == ("truncated", "rgb_to_event", 50.0)


@pytest.mark.parametrize(
    ("key", "dtype", "readable"),
    [
        ("path/events/t", "float64", True),
        ("path/events/t", ">i8", None),
        ("path/imu/angular_velocity", "float32", True),
        ("path/depth", "float64", True),
        ("path/depth", "uint16", True),
        ("path/rgb", "uint16", False),
        ("path/rgb", "float32", False),
        ("path/pose/position", "complex128", False),
        ("path/pose/position", "S8", False),
    ],
)
def test_types(file: h5py.File, key: str, dtype: str, readable: bool | None) -> None:
    """Another type is a problem; it is still read where a safe conversion exists. Byte order is nobody's business."""
    values = np.zeros(file[key].shape) if key == "path/depth" else file[key][()]
    replace(file, key, values.astype(dtype))
    layout = resolve(file)
    if readable is None:
        assert not layout.problems
        return
    assert only_problem(layout) == ("wrong_dtype", "wrong_dtype", DATASETS[key].stream, key)
    assert (key in layout.bindings) is readable


def test_members_of_compound_types_need_a_dialect(file: h5py.File) -> None:
    """The message names them, and what to do."""
    del file["path/events/x"]
    file.create_dataset("path/events/x", (4,), dtype=np.dtype([("x", "u2"), ("y", "u2")]))
    (problem,) = resolve(file).problems
    assert "a compound type with the members x, y" in problem.message
    assert 'such as members = ["x"]' in problem.message


@pytest.mark.parametrize("own", [True, False])
def test_a_place_in_an_own_dialect_that_the_file_lacks_is_noted(file: h5py.File, tmp_path: Path, own: bool) -> None:
    """A packaged dialect has places for streams that most of its files lack."""
    del file["path/events"]
    dialect = tmp_path / "mine.toml"
    places = "".join(f'"path/events/{name}" = {{ path = "path/event/{name}" }}\n' for name in "xytp" if own)
    dialect.write_text(f'name = "mine"\ndescription = "own"\ncanonical_elsewhere = true\n[datasets]\n{places}')
    notes = [problem for problem in resolve(file, load_dialect(str(dialect))).problems if problem.is_lossless]
    assert [(note.stream, note.code) for note in notes] == [("events", "integrity.layout.missing_stream")] * own


@pytest.mark.parametrize("dtype", [h5py.string_dtype(), h5py.vlen_dtype(np.int64), np.dtype([("t", "i8")])])
def test_types_that_are_no_numbers_are_refused(file: h5py.File, dtype: np.dtype) -> None:
    """Strings, ragged arrays and compounds are never read as stamps."""
    del file["path/pose/ts"]
    file.create_dataset("path/pose/ts", (21,), dtype=dtype)
    layout = resolve(file)
    assert only_problem(layout)[:3] == ("wrong_dtype", "wrong_dtype", "pose")
    assert "pose" not in layout.streams


def test_chunks_that_were_never_written(file: h5py.File) -> None:
    """A writer that was stopped leaves chunks without bytes, which HDF5 reads as zeros without a word."""
    del file["path/depth"]
    depth = file.create_dataset("path/depth", (6, 27, 36), "float32", chunks=(1, 27, 36))
    depth[:4] = 5000.0
    (problem,) = resolve(file).problems
    assert (problem.cause, problem.stream) == ("truncated", "depth")
    assert problem.magnitude == pytest.approx(100 * 2 / 6)


def test_no_events_at_all_is_legal(file: h5py.File) -> None:
    """A still scene gives no events: empty datasets are whole."""
    for name in "xytp":
        dtype = file[f"path/events/{name}"].dtype
        replace(file, f"path/events/{name}", np.zeros(0, dtype=dtype))
    assert not resolve(file).problems


def test_malformed_depth_range_is_of_the_metadata(file: h5py.File) -> None:
    """The depth range is a declaration, not a stream."""
    replace(file, "metadata/depth_range", np.zeros(3))
    assert only_problem(resolve(file)) == ("wrong_shape", "wrong_shape", "metadata", "metadata/depth_range")


@pytest.mark.parametrize("stream", ["rgb", "depth", "imu", "pose"])
def test_an_empty_stream_is_missing(file: h5py.File, stream: str) -> None:
    """Datasets without a row are a declared stream that is absent, and no other stream suffers."""
    specs = [spec for spec in DATASETS.values() if spec.stream == stream]
    for spec in specs:
        replace(file, spec.key, file[spec.key][:0])
    if (index_map := f"metadata/{stream}_to_event") in file:
        replace(file, index_map, file[index_map][:0])
    layout = resolve(file)
    assert only_problem(layout) == ("empty", "missing_stream", stream, specs[0].key)
    assert layout.streams == set(STREAMS) - {stream}


@pytest.mark.parametrize(("stream", "group"), [("events", "path/events"), ("imu", "path/imu"), ("pose", "path/pose")])
def test_a_group_declares_its_stream(file: h5py.File, stream: str, group: str) -> None:
    """A group without its datasets is a stream that was not written, whatever the metadata declare."""
    del file[group], file[f"metadata/{stream}"], file["metadata/rgb_to_event"], file["metadata/depth_to_event"]
    assert not resolve(file).problems
    file.create_group(group)
    assert only_problem(resolve(file)) == ("missing_stream", "missing_stream", stream, "")


def test_a_group_declares_flow(file: h5py.File) -> None:
    """An empty group of flow is flow of no rate."""
    del file["path/flow"], file["metadata/flow"]
    assert not resolve(file).problems
    file.create_group("path/flow")
    assert only_problem(resolve(file)) == ("missing_stream", "missing_stream", "flow", "")


@pytest.mark.parametrize("frames", ["rgb", "depth"])
def test_an_index_map_declares_its_frames(file: h5py.File, frames: str) -> None:
    """A map from frames to events is of no use without both."""
    del file[f"path/{frames}"], file[f"path/{frames}_ts"], file[f"metadata/cameras/{frames}"]
    assert only_problem(resolve(file)) == ("missing_stream", "missing_stream", frames, "")


def test_an_index_map_declares_events(file: h5py.File) -> None:
    """Two maps into events that are not there are one missing stream."""
    del file["path/events"], file["metadata/events"]
    assert only_problem(resolve(file)) == ("missing_stream", "missing_stream", "events", "")


@pytest.mark.parametrize(
    ("key", "dtype", "lossless"),
    [
        ("path/depth", "float64", True),
        ("path/depth", "uint16", True),
        ("path/depth", "float16", False),
        ("path/depth", "uint8", False),
        ("path/imu/angular_velocity", "float32", True),
        ("path/imu/angular_velocity", "int16", False),
        ("path/pose/position", "float16", False),
        ("path/flow/10hz", "float64", True),
        ("path/flow/10hz", "int16", False),
        ("path/events/x", "uint32", True),
        ("path/events/x", "float32", True),
        ("path/events/x", "float16", False),
        ("path/events/p", "bool", True),
        ("path/rgb_ts", "float64", True),
        ("path/rgb_ts", "float32", False),
        ("path/rgb_ts", "uint32", True),
        ("metadata/rgb_to_event", "float64", True),
    ],
)
def test_types_that_hold_the_same_values(file: h5py.File, key: str, dtype: str, lossless: bool) -> None:
    """Wider types, and whole numbers in others, are unusual; types that lose what the layout holds are wrong."""
    values = np.nan_to_num(file[key][()])
    replace(file, key, values.astype(dtype))
    (problem,) = resolve(file).problems
    assert (problem.cause, problem.is_lossless) == ("wrong_dtype", lossless)
    assert ("--draft-dialect" in problem.message) is lossless


@pytest.mark.parametrize("dtype", ["int8", "int32", "float32"])
def test_signed_polarity_is_inferred(file: h5py.File, dtype: str) -> None:
    """-1 beside 1 and no 0 is darker; the record states that it was inferred."""
    replace(file, "path/events/p", (2 * file["path/events/p"][()].astype(int) - 1).astype(dtype))
    layout = resolve(file)
    assert layout.bindings["path/events/p"].polarity == "plus_minus"
    assert "events.polarity" in layout.inferred


def test_three_polarities_are_not_inferred(file: h5py.File) -> None:
    """-1, 0 and 1 are no code: what is not 0 or 1 stays undefined."""
    polarity = file["path/events/p"][()].astype(np.int8)
    polarity[3] = -1
    replace(file, "path/events/p", polarity)
    assert resolve(file).bindings["path/events/p"].polarity == "01"


def test_nothing_is_recognised_in_a_file_of_something_else(tmp_path: Path) -> None:
    """A file without a dataset of any dialect; a single one, or the name of the format, is enough to be one."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["weights"] = np.zeros(3)
        assert not resolve(file).is_recognised
        file["path/imu/ts"] = np.arange(4)
        assert resolve(file).is_recognised
        del file["path"]
        assert not resolve(file).is_recognised
        file.attrs["format"] = "fedora"
        assert resolve(file).is_recognised


def test_fractions_of_microseconds_are_no_whole_numbers(file: h5py.File) -> None:
    """Stamps in float64 hold the same values only where they are whole."""
    replace(file, "path/imu/ts", file["path/imu/ts"][()] + 0.25)
    (problem,) = resolve(file).problems
    assert (problem.cause, problem.is_lossless) == ("wrong_dtype", False)


def test_columns_beyond_their_type_are_not_lossless(file: h5py.File) -> None:
    """A wider type is lossless only where the layout's type holds what it holds."""
    replace(file, "path/events/x", np.full(file["path/events/x"].shape, 2**40))
    (problem,) = resolve(file).problems
    assert (problem.cause, problem.is_lossless) == ("wrong_dtype", False)
