"""CSV tables are read by the standard reader and by pandas, and no cell is a formula."""

import csv
import io

import pandas as pd
import pytest
from hypothesis import given

from fedora_qa.record.tables import CSV_NAMES, record_to_csv, table_to_csv
from fedora_qa.record.types import Record
from tests.support.random_records import records, unhurried
from tests.support.records import file_record, record


def rows_of(shown: Record, name: str) -> list[dict[str, str]]:
    """The rows of a table, as the standard reader gives them."""
    return list(csv.DictReader(io.StringIO(record_to_csv(shown)[name], newline="")))


def test_the_tables_hold_the_record() -> None:
    """Outcomes, numbers, places, causes and statistics stand in their tables, each beside its file."""
    shown = record()
    assert [row["outcome"] for row in rows_of(shown, "results.csv")] == ["failed", "passed", "not_observable"]
    measured = rows_of(shown, "measurements.csv")[1]
    assert (measured["file"], measured["name"], measured["value"], measured["unit"]) == (
        "seq.h5", "offset", "2.0634", "ms",
    )  # fmt: skip
    finding = rows_of(shown, "findings.csv")[0]
    assert (finding["code"], finding["stream"], finding["stop_us"]) == (
        "event_response.timing.offset", "events", "2000000.0",
    )  # fmt: skip
    assert rows_of(shown, "diagnoses.csv")[0]["cause"] == "time_offset"
    assert {row["name"]: row["value"] for row in rows_of(shown, "statistics.csv")} == {
        "duration_s": "2.0",
        "event_rate_mean_per_s": "",
    }


def test_pandas_reads_numbers() -> None:
    """A column of numbers with gaps is one of floats."""
    frame = pd.read_csv(io.StringIO(record_to_csv(record())["measurements.csv"]))
    assert frame["value"].dtype == float
    assert frame["value"].max() == pytest.approx(2.0634)


@pytest.mark.parametrize("path", ["=1+1.h5", "+x.h5", "-x.h5", "@x.h5"])
def test_no_cell_is_a_formula(path: str) -> None:
    """A name that a spreadsheet would calculate is marked as text."""
    assert rows_of(record(file_record(path=path)), "files.csv")[0]["file"] == f"'{path}"


def test_tables_of_text_keep_their_numbers() -> None:
    """Negative numbers stay numbers, absent ones leave their cells empty, and what is calculated is marked."""
    text = table_to_csv(("name", "a, b"), [("-2.5", "–"), ("=1", "1.5 ± 0.2")])
    assert text.splitlines() == ['name,"a, b"', "-2.5,", "'=1,1.5 ± 0.2"]


@unhurried
@given(records())
def test_any_text_stays_in_its_cell(shown: Record) -> None:
    """Whatever the text, each row has the cells of its head, and there is a row for each result."""
    for name in CSV_NAMES:
        head, *rows = csv.reader(io.StringIO(record_to_csv(shown)[name], newline=""), strict=True)
        assert all(len(row) == len(head) for row in rows)
    assert len(rows_of(shown, "results.csv")) == sum(len(file.results) for file in shown.files)
