"""Parquet tables are read by pandas, hold what the record holds, and keep the type of every column."""

import math
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given

from fedora_qa.cli.outputs import PARQUET_NAMES, arrow_table, write_parquet
from fedora_qa.record.tables import TABLE_NAMES, table_of, tables_of
from fedora_qa.record.types import Record
from tests.support.random_records import records, unhurried
from tests.support.records import HOT, failed, file_record, late_events, passed, record


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The tables of a record with findings, one of them at a pixel, and statistics of every type."""
    found = failed()
    hot = replace(found, findings=(*found.findings, replace(found.findings[1], id="F3", where=HOT)))
    statistics = {"events": {"count": 7, "share": math.nan, "model": "log", "dense": True, "rate": None}}
    file = replace(file_record(hot, passed(), diagnoses=(late_events(),)), statistics=statistics)
    write_parquet(tmp_path, record(file, file_record(passed(), path="b.h5")))
    return tmp_path


def read(folder: Path, name: str) -> pd.DataFrame:
    """A table as pandas reads it."""
    return pd.read_parquet(folder / f"{name}.parquet")


def test_every_table_is_there(folder: Path) -> None:
    """One file a table, and nothing else."""
    assert {path.name for path in folder.iterdir()} == set(PARQUET_NAMES)


def test_numbers_are_numbers(folder: Path) -> None:
    """Values are floats with gaps, counts are integers, and a check of many measurements has a row for each."""
    measured = read(folder, "measurements")
    assert measured["value"].dtype == float
    assert measured["tests"].dtype == int
    assert measured["value"].max() == pytest.approx(2.0634)
    assert list(read(folder, "files")["verdict"]) == ["findings", "clean"]


def test_places_are_lists(folder: Path) -> None:
    """A pixel is a list of two numbers, what does not apply is null, and causes list their findings."""
    findings = read(folder, "findings").set_index("id")
    assert list(findings.loc["F3", "pixel"]) == list(HOT.pixel or ())
    assert findings["pixel"].isna().sum() == 2
    assert findings.loc["F1", "stop_us"] == 2_000_000.0
    assert list(read(folder, "diagnoses").loc[0, "explains"]) == ["F1"]


def test_statistics_of_any_type(folder: Path) -> None:
    """Numbers stand in one column, text and truth in another; what is not finite is not known, as in the JSON."""
    statistics = read(folder, "statistics").set_index("name")
    events = statistics[statistics["group"] == "events"]
    assert events.loc["count", "value"] == 7
    assert events.loc[["model", "dense"], "value_text"].to_list() == ["log", "true"]
    assert events["value"].isna().to_dict() == {
        "count": False, "share": True, "model": True, "dense": True, "rate": True,
    }  # fmt: skip


def test_types_do_not_depend_on_the_values(folder: Path, tmp_path: Path) -> None:
    """A record without findings has columns of the same types, so that files can be read together."""
    other = tmp_path / "other"
    other.mkdir()
    write_parquet(other, record(file_record(passed())))
    for name in PARQUET_NAMES:
        assert pq.read_schema(folder / name).equals(pq.read_schema(other / name))


def test_an_undecodable_path_is_an_escape() -> None:
    """A file name that is no UTF-8 reads as in the JSON."""
    shown = record(file_record(passed(), path=b"seq\xff.h5".decode("utf-8", "surrogateescape")))
    assert arrow_table(table_of(shown, "files"))["file"].to_pylist() == ["seq\\udcff.h5"]


@unhurried
@given(records())
def test_any_record_fits(shown: Record) -> None:
    """Whatever a record holds, every row of every table is there."""
    for table in tables_of(shown):
        assert arrow_table(table).num_rows == len(table.rows)
    assert len(table_of(shown, "results").rows) == sum(len(file.results) for file in shown.files)


def test_all_tables_have_a_name() -> None:
    """Tables come in the order of their names."""
    assert tuple(table.name for table in tables_of(record())) == TABLE_NAMES
