"""What releases cost follows from two lengths, and a folder is decoded whole."""

from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest

from tests.benchmarks.release_costs.costs import Dataset, Measured, unit_cost
from tests.benchmarks.release_costs.folder_reading import decode_folder
from tests.benchmarks.release_costs.page import Source, page


def test_a_line_through_two_lengths() -> None:
    """3 s for a sequence and 2 s for each second of it: 10 sequences of 100 s take 10 * 3 + 1000 * 2 s."""
    cost = unit_cost(Measured(4.0, 11.0, 6.0, 40.0), Measured(8.0, 19.0, 10.0, 80.0))
    dataset = Dataset("any", 10, 1000.0)
    assert cost.core_h(dataset) == pytest.approx(2030 / 3600)
    assert cost.read_bytes(dataset) == pytest.approx(10_000)
    assert cost.bytes_per_core_s == pytest.approx(5.0)


@pytest.mark.parametrize("longer", [Measured(8.0, 10.0, 6.0, 80.0), Measured(4.0, 19.0, 6.0, 80.0)])
def test_no_line_goes_through(longer: Measured) -> None:
    with pytest.raises(ValueError, match="Expected a longer sequence that takes more processor time"):
        unit_cost(Measured(4.0, 11.0, 6.0, 40.0), longer)


def test_a_folder_is_decoded_whole(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images/0.png"), np.zeros((4, 6, 3), np.uint8))
    with h5py.File(tmp_path / "events.h5", "w") as file:
        file["events/t"] = np.arange(5, dtype=np.int64)
    assert decode_folder(tmp_path) == 4 * 6 * 3 + 5 * 8
    (tmp_path / "images/1.png").write_text("no image")
    with pytest.raises(RuntimeError, match=r"1\.png"):
        decode_folder(tmp_path)


def test_the_page_states_costs() -> None:
    """1 core second and 100 MB a second of sequence: 60,000 s are 16.7 core hours and 6 TB."""
    measured = {"full": [Measured(4.0, 4.0, 3.0, 4e8), Measured(8.0, 8.0, 5.0, 8e8)]}
    text = "".join(page(Source("files", measured), Source("folders", measured), {4.0: 2.0, 8.0: 4.0}))
    assert "| 1,000 simulated flights of a minute, 1000 min | full | 17 | 1 | 0.83 | 6 |" in text
    assert "| files | full | 100 | 2.0 | 1 | 12 | 31 |" in text
    assert "| 4 | 2.0 | 1.50 |" in text
