"""Evidence that is put aside: the same arrays, and none of them in memory."""

import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fedora_qa.cli.arrays import ArrayStore
from fedora_qa.cli.check import Request, check_all
from fedora_qa.cli.record import evidence_arrays
from fedora_qa.config import CheckConfig
from fedora_qa.engine.executors.executor import InProcess
from fedora_qa.engine.options import CheckOptions, FileRun
from tests.support.records import file_record, passed


def test_arrays_return() -> None:
    """Of any shape and type, in any order of reading, also after more were put."""
    store = ArrayStore()
    arrays = {"a": np.arange(6).reshape(2, 3), "b": np.array(True), "c": np.empty((0, 2), np.float32)}
    first, other = store.put(arrays), store.put({"a": np.array(["text"])})
    assert list(first) == list(arrays)
    for name in ("c", "a", "b"):
        np.testing.assert_array_equal(first[name], arrays[name], strict=True)
    assert other["a"].tolist() == ["text"]
    assert len(store.put({})) == 0


def test_objects_are_refused() -> None:
    """To read them would execute code."""
    with pytest.raises(ValueError, match="Object arrays"):
        ArrayStore().put({"a": np.array([{}])})


def test_no_evidence_of_earlier_files_stays_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It lies on disk under the names that the record has."""
    paths = [tmp_path / f"{number}.h5" for number in range(3)]
    alive: list[weakref.ref[Any]] = []

    def check_files(*_: Any) -> Iterator[tuple[Path, FileRun]]:
        for number, path in enumerate(paths):
            array = np.full(1000, number)
            alive.append(weakref.ref(array))
            run = FileRun(file_record(passed(), path=str(path)), {"x": array})
            del array
            yield path, run

    for path in paths:
        path.write_bytes(b"")
    monkeypatch.setattr("fedora_qa.cli.check.check_files", check_files)
    monkeypatch.setattr("fedora_qa.cli.check.compile_for", lambda *_: None)
    runs = check_all(paths, Request(CheckConfig(), CheckOptions(), "", aside=ArrayStore()), InProcess())
    assert [each() for each in alive] == [None] * 3
    arrays = evidence_arrays(runs)
    assert {name: int(array[-1]) for name, array in arrays.items()} == {"0/x": 0, "1/x": 1, "2/x": 2}
    assert "1/x" in arrays
    assert "x" not in arrays
