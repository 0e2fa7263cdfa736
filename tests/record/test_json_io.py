"""A record survives JSON, and what is not a record is refused by name."""

import json
import math
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import RECORD, read_record, record_from_json, record_parts, record_to_json, write_record
from fedora_qa.record.types import FileRecord, Finding, Measurement, Where
from tests.support.records import crashed, failed, file_record, passed, record


def refuse_constant(name: str) -> float:
    raise AssertionError(f"bare token {name}")


def with_value(value: float) -> FileRecord:
    measured = Measurement("offset", value, "ms", value, 0.0, None, value)
    return file_record(replace(passed(), measurements=(measured,)))


def test_round_trip_through_a_file(tmp_path: Path) -> None:
    """What is written is read back equal, tracebacks and warnings included."""
    written = record(file_record(failed(), crashed()), file_record(passed(), path="other.h5"))
    write_record(written, tmp_path / "record.json")
    assert read_record(tmp_path / "record.json") == written
    assert [path.name for path in tmp_path.iterdir()] == ["record.json"]


def test_parts_are_the_document() -> None:
    """A record is written a file at a time, as the whole would be: three files, one, and none."""
    for count in (3, 1, 0):
        files = tuple(file_record(failed(), crashed(), path='a "files": [] \n b') for _ in range(count))
        written = replace(record(), files=files)
        assert record_to_json(written) == RECORD.to_json(written)
        assert len(list(record_parts(written))) == (count + 2 if count else 1)


def test_memory_of_writing_does_not_grow_with_files() -> None:
    """Plain values exist of one file at a time."""
    peaks = []
    for count in (2, 40):
        written = record(*[file_record(*[failed()] * 50)] * count)
        tracemalloc.start()
        for _ in record_parts(written):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]


@given(st.floats())
def test_no_bare_tokens(value: float) -> None:
    """Whatever number was measured, the JSON is strict: a number that is none is null, every other is exact."""
    text = record_to_json(record(with_value(value)))
    json.loads(text, parse_constant=refuse_constant)
    read = record_from_json(text).files[0].results[0].measurements[0]
    assert read.value == (value if math.isfinite(value) else None)


places = st.builds(
    Where,
    stream=st.none() | st.text(),
    start_us=st.none() | st.floats(allow_nan=False, allow_infinity=False),
    index_start=st.none() | st.integers(-(2**62), 2**62),
    frame=st.none() | st.integers(0, 2**40),
    pixel=st.none() | st.tuples(st.integers(0, 2000), st.integers(0, 2000)),
)


@given(message=st.text(), where=places)
def test_any_text_and_place_round_trips(message: str, where: Where) -> None:
    """Messages keep every character, and places every microsecond and row."""
    finding = Finding("F1", "subject.property.rule", "error", message, where)
    written = record(file_record(replace(failed(), findings=(finding,))))
    assert record_from_json(record_to_json(written)) == written


def test_scalars_of_an_array_library_are_written() -> None:
    """NumPy's integers and floats become plain numbers."""
    values = {"events": {"count": np.int64(7), "share": np.float32(0.5)}}
    written = record_to_json(record(replace(file_record(passed()), statistics=values)))
    assert record_from_json(written).files[0].statistics["events"] == {"count": 7, "share": 0.5}


def test_undecodable_path_is_written_as_an_escape() -> None:
    """A file name that is no UTF-8 does not stop the record from being written."""
    name = b"seq\xff.h5".decode("utf-8", "surrogateescape")
    read = record_from_json(record_to_json(record(file_record(passed(), path=name))))
    assert read.files[0].path == "seq\\udcff.h5"


def test_an_illegal_record_is_not_written(tmp_path: Path) -> None:
    """A record that could not be read back leaves no file, and the old one alone."""
    target = tmp_path / "record.json"
    target.write_text("old")
    illegal = replace(file_record(passed()), size="large")  # type: ignore[arg-type]
    with pytest.raises(ValidationError):
        write_record(record(illegal), target)
    assert target.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


REFUSED = {
    "no JSON": ("hello", "as JSON"),
    "bytes that are no text": (b"\x89HDF\r\n", "as JSON"),
    "a list": ("[]", "record_version '1.1', got None"),
    "another version": ('{"record_version": "9.0"}', "got '9.0'"),
    "fields missing": ('{"record_version": "1.0"}', "ruleset_version"),
}


@pytest.mark.parametrize(("text", "named"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_record_is_refused(text: str | bytes, named: str) -> None:
    """The error names what is wrong and where."""
    with pytest.raises(MisuseError, match="Expected") as refused:
        record_from_json(text)
    assert named in str(refused.value)


def test_a_wrong_field_is_named_with_its_place() -> None:
    """The error says which field of which result is wrong."""
    document = json.loads(record_to_json(record()))
    document["files"][0]["results"][1]["outcome"] = "splendid"
    with pytest.raises(MisuseError, match=r"files\.0\.results\.1\.outcome"):
        record_from_json(json.dumps(document))


def test_missing_record(tmp_path: Path) -> None:
    """A path without a file is misuse, not a crash."""
    with pytest.raises(MisuseError, match="No such file"):
        read_record(tmp_path / "none.json")
