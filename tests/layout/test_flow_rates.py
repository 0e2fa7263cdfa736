"""Flow of whatever rates a file holds is found; a name that is no rate is named."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.causes import allowed, stream_family
from fedora_qa.errors import MisuseError
from fedora_qa.layout.canonical import (
    FLOW_STREAMS,
    STREAMS,
    datasets_of,
    datasets_of_all,
    flow_rate_hz,
    flow_stream_of,
    in_file_order,
    is_dataset_key,
    is_flow_stream,
    spec_of,
    timestamps_of,
)
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.draft_file import draft_dialect
from fedora_qa.layout.resolve import resolve
from tests.support.handmade import write_handmade


@pytest.fixture
def file(tmp_path: Path) -> Iterator[h5py.File]:
    """The handmade file, open for changes."""
    with h5py.File(write_handmade(tmp_path / "hand.h5"), "r+") as opened:
        yield opened


def rename(file: h5py.File, old: str, new: str) -> None:
    for ending in ("hz", "hz_ts"):
        file.move(f"path/flow/{old}{ending}", f"path/flow/{new}{ending}")


@given(st.decimals("0.000001", "1000000", places=6))
def test_a_rate_is_read_from_the_name(rate_hz: object) -> None:
    """Any decimal number is a rate; its datasets are those of the usual rates under its own name."""
    stream = f"flow/{rate_hz}hz"
    assert is_flow_stream(stream)
    assert flow_rate_hz(stream) == float(Fraction(str(rate_hz)))
    assert stream_family(stream) == "flow"
    assert [spec.key for spec in datasets_of(stream)] == [f"path/{stream}", timestamps_of(stream)]
    for spec in datasets_of_all({stream}):
        assert flow_stream_of(spec.key) == spec.stream == stream
        assert spec_of(spec.key) == spec
        usual = spec_of(spec.key.replace(stream, "flow/25hz"))
        assert (spec.dtype, spec.units, spec.optional) == (usual.dtype, usual.units, usual.optional)
        assert spec.shape[1:] == usual.shape[1:]


@pytest.mark.parametrize(
    "name", ["flow/hz", "flow/0hz", "flow/0.0hz", "flow/-5hz", "flow/nanhz", "flow/infhz", "flow/1e3hz", "flow/25Hz",
             "flow/1000001hz", "flow/٢٥hz", "flow/ 25hz", "flow/25.hz", "flow/.5hz", "flow/25", "flow", "rgb"]
)  # fmt: skip
def test_other_names_are_no_rates(name: str) -> None:
    """Only a number above zero in digits is a rate."""
    assert not is_flow_stream(name)
    assert not is_dataset_key(f"path/{name}_moving")
    with pytest.raises(KeyError):
        spec_of(f"path/{name}_moving")


def test_rates_are_in_the_order_of_numbers() -> None:
    """As text, 100hz would come before 12.5hz."""
    streams = {"pose", "flow/100hz", "flow/12.5hz", "flow/5hz", "rgb_to_event"}
    assert in_file_order(streams) == ("pose", "flow/5hz", "flow/12.5hz", "flow/100hz", "rgb_to_event")
    assert in_file_order(STREAMS) == STREAMS


def test_a_file_with_other_rates_is_asked_for_no_usual_one(file: h5py.File) -> None:
    """Rates of the file are its streams; those of the paper are neither promised nor absent."""
    rename(file, "10", "12.5")
    rename(file, "25", "20")
    del file["path/flow/50hz"], file["path/flow/50hz_ts"]
    layout = resolve(file)
    assert layout.streams == {*STREAMS, "flow/12.5hz", "flow/20hz"} - {*FLOW_STREAMS}
    assert not layout.problems
    assert not layout.absent
    assert list(layout.bindings).index("path/flow/12.5hz") < list(layout.bindings).index("path/flow/20hz")


def test_a_part_of_another_rate_is_reported_as_of_a_usual_one(file: h5py.File) -> None:
    """Timestamps that are missing, and masks of another shape, are defects of that rate."""
    rename(file, "10", "12.5")
    file["path/flow/12.5hz_moving"] = np.zeros((1, 2, 3), np.uint8)
    (problem,) = resolve(file).problems
    assert (problem.stream, problem.key, problem.cause) == ("flow/12.5hz", "path/flow/12.5hz_moving", "wrong_shape")
    del file["path/flow/12.5hz_moving"], file["path/flow/12.5hz_ts"]
    layout = resolve(file)
    (problem,) = layout.problems
    assert (problem.stream, problem.key, problem.cause) == ("flow/12.5hz", "path/flow/12.5hz_ts", "missing_stream")
    assert layout.streams == {*STREAMS} - {"flow/10hz"}


@pytest.mark.parametrize("name", ["fasthz", "0hz", "-5hz", "nanhz", "1e3hz", "25Hz", "25", "9999999hz"])
def test_a_name_that_is_no_rate(file: h5py.File, name: str) -> None:
    """It is named once, and the other rates are read."""
    file.move("path/flow/25hz", f"path/flow/{name}")
    file.move("path/flow/25hz_ts", f"path/flow/{name}_ts")
    layout = resolve(file)
    (problem,) = layout.problems
    assert problem.code == "integrity.layout.rate_name"
    assert problem.message == (
        "Expected path/flow/<R>hz with a rate R above 0 and up to 1e+06, in digits such as 12.5, got "
        f"path/flow/{name}; rename it"
    )
    assert allowed(problem.cause, problem.stream)
    assert layout.streams == {*STREAMS} - {"flow/25hz"}


def test_other_names_beside_flow_are_no_rates(file: h5py.File) -> None:
    """Notes and datasets that others put there are unused, and no defect."""
    file["path/flow/notes"] = 1.0
    file["path/flow/25hz_occlusion"] = np.zeros(3)
    assert not resolve(file).problems


def test_two_names_of_one_rate(file: h5py.File) -> None:
    """Which is meant cannot be known: the plain name is read, and the other named."""
    for ending in ("", "_ts"):
        file.copy(f"path/flow/25hz{ending}", f"path/flow/25.0hz{ending}")
    layout = resolve(file)
    (problem,) = layout.problems
    assert (problem.code, problem.stream) == ("integrity.layout.two_names", "flow/25hz")
    assert problem.key == "path/flow/25.0hz"
    assert problem.message.startswith("Expected one flow of 25 Hz, got path/flow/25hz and path/flow/25.0hz")
    assert layout.streams == set(STREAMS)


def test_a_rate_with_needless_zeros_alone_is_read_as_it_is_named(file: h5py.File) -> None:
    """The name is the file's."""
    rename(file, "25", "25.0")
    layout = resolve(file)
    assert layout.streams == {*STREAMS, "flow/25.0hz"} - {"flow/25hz"}
    assert not layout.problems


def test_a_file_of_very_many_rates(file: h5py.File) -> None:
    """A number of them is read, and the finding states how many there are."""
    for rate_hz in range(100, 150):
        for ending in ("", "_ts"):
            file[f"path/flow/{rate_hz}hz{ending}"] = h5py.SoftLink(f"/path/flow/25hz{ending}")
    layout = resolve(file)
    (problem,) = layout.problems
    assert (problem.code, problem.stream) == ("integrity.layout.too_many", "flow")
    assert "got 53" in problem.message
    assert len(layout.streams) == len(STREAMS) - 3 + 32


def test_no_flow_where_flow_is_declared(file: h5py.File) -> None:
    """Any rate fulfils the declaration, and without any it is broken."""
    rename(file, "10", "12.5")
    for rate in ("25", "50"):
        del file[f"path/flow/{rate}hz"], file[f"path/flow/{rate}hz_ts"]
    assert not resolve(file).problems
    del file["path/flow/12.5hz"], file["path/flow/12.5hz_ts"]
    (problem,) = resolve(file).problems
    assert (problem.stream, problem.cause) == ("flow", "missing_stream")


def test_a_dialect_places_any_rate(file: h5py.File, tmp_path: Path) -> None:
    """It finds them where they lie, and refuses two names of one."""
    rename(file, "10", "12.5")
    file.move("path/flow/12.5hz", "flow")
    file.move("path/flow/12.5hz_ts", "flow_times")
    path = tmp_path / "mine.toml"
    lines = ['name = "mine"', "[datasets]", '"path/flow/12.5hz" = { path = "flow" }']
    path.write_text("\n".join([*lines, '"path/flow/12.5hz_ts" = { path = "flow_times", time_unit = "us" }']))
    layout = resolve(file, load_dialect(path))
    assert layout.streams == {"flow/12.5hz"}
    assert not layout.problems
    path.write_text("\n".join([*lines, '"path/flow/12.50hz" = { path = "flow" }']))
    with pytest.raises(MisuseError, match=r"Expected each rate of flow once, got path/flow/12\.5hz as well"):
        load_dialect(path)
    path.write_text("\n".join([*lines, '"path/flow/0hz" = { path = "flow" }']))
    with pytest.raises(MisuseError, match="Expected a canonical key"):
        load_dialect(path)


@pytest.mark.parametrize(
    ("length_us", "rate"),
    [(100_000, "10"), (101_000, "10"), (80_000, "12.5"), (33_333, "30"), (33_367, "29.97"), (200_000, "5"),
     (1_000_000, "1"), (12_345, "81"), (10_000, "100")],
)  # fmt: skip
def test_a_draft_states_the_rate_of_the_intervals(tmp_path: Path, length_us: int, rate: str) -> None:
    """A usual rate where the length is near, else the rate with as few decimals as state it."""
    starts_us = np.arange(4) * length_us
    with h5py.File(tmp_path / "unknown.h5", "w") as file:
        file["of"] = np.zeros((4, 9, 12, 2), np.float32)
        file["of_times"] = np.column_stack([starts_us, starts_us + length_us])
        draft = draft_dialect(file, "unknown")
    assert f'"path/flow/{rate}hz" = {{ path = "of" }}' in draft
    assert f'"path/flow/{rate}hz_ts" = {{ path = "of_times", time_unit = "us" }}' in draft
