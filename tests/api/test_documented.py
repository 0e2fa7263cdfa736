"""What the documentation shows in Python runs as it stands."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fedora_qa
from fedora_qa.cli.outputs import write_parquet
from fedora_qa.comparison.types import COMPARISON
from fedora_qa.scoring.types import SCORE
from tests.support.documented import blocks
from tests.support.handmade import HEIGHT, WIDTH, write_handmade

EXAMPLES = blocks("python.md", "python")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files that the examples name, in which they run."""
    for name in ("late.h5", "release/a.h5", "release/b.h5", "v1/park.h5", "v2/park.h5"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        write_handmade(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_one_file(folder: Path) -> None:
    """The first example checks a file and saves a record."""
    exec(EXAMPLES[0], {})
    assert fedora_qa.read_record(folder / "late.json").files[0].path == "late.h5"


def test_many_files(folder: Path) -> None:
    """The second checks a folder and counts outcomes; here without processes of its own."""
    example = EXAMPLES[1].replace("jobs=4", "jobs=1, select=['clocks']")
    names = {"fedora_qa": fedora_qa, "__name__": "__main__"}
    exec(example, names)
    assert len(names["record"].files) == 2  # type: ignore[attr-defined]


def results_of(example: str) -> dict[str, Any]:
    """The names that an example binds, after it has run."""
    names: dict[str, Any] = {"fedora_qa": fedora_qa}
    exec(example, names)
    return names


def test_no_example_is_left_out() -> None:
    """The tests of this module run every example of the page."""
    assert len(EXAMPLES) == 9


def test_gate(folder: Path) -> None:
    """The sequences and the release are clean, and certified."""
    (folder / "policy.toml").write_text('ruleset_version = "2"\n[check]\nselect = ["clocks.order"]\n')
    release = results_of(EXAMPLES[2])["release"]
    assert [Path(file.path).name for file in release.files] == ["a.h5", "b.h5", "release"]
    assert release.verdict == "clean"
    assert (folder / "certificate.json").is_file()


def test_compare(folder: Path) -> None:
    """Equal files are identical, and what is saved is what the command writes."""
    names = results_of(EXAMPLES[3])
    assert {difference.told for difference in names["differences"]} == {"identical"}
    assert COMPARISON.from_json((folder / "comparison.json").read_text("utf-8")).pairs == names["comparison"].pairs


def test_stats(folder: Path) -> None:
    """Numbers by name, and as a data frame."""
    names = results_of(EXAMPLES[4])
    frame = names["statistics"].frame
    assert names["duration_s"] == frame[frame["name"] == "duration_s"]["value"].item() > 0


def test_explain() -> None:
    """One check, and all of a subject."""
    names = results_of(EXAMPLES[5])
    assert [each.check for each in names["explained"]] == ["clocks.order"]
    assert len(names["names"]) > 1
    assert {name.split(".")[0] for name in names["names"]} == {"imu"}


def test_repair(folder: Path) -> None:
    """A sound file needs no repair."""
    assert results_of(EXAMPLES[6])["planned"].refusal


def test_rows(folder: Path) -> None:
    """The first ten samples of the IMU, in canonical units."""
    names = results_of(EXAMPLES[7])
    assert names["timestamps_ns"].shape == (10,)
    assert names["angular_velocity"].shape == (10, 3)


def test_score(folder: Path) -> None:
    """A file as a prediction of itself: no error, and what is saved is what the command writes."""
    scored = results_of(EXAMPLES[8])["scored"]
    assert [flow.parts[0].aee_px for flow in scored.flow] == [0.0, 0.0, 0.0]
    assert SCORE.from_json((folder / "score.json").read_text("utf-8")).flow == scored.flow


def test_written_predictions(folder: Path) -> None:
    """The example of the page on scores writes predictions that fit the sequence."""
    write_handmade(folder / "seq.h5")
    exec(blocks("score.md", "python")[0], {"predict": lambda start_us, stop_us: np.full((HEIGHT, WIDTH, 2), 0.25)})
    (flow,) = fedora_qa.score("predictions.h5", "seq.h5").flow
    assert (flow.parts[0].coverage, flow.parts[0].aee_px) == (1.0, pytest.approx(0.25 * 2**0.5))


def test_tables(folder: Path) -> None:
    """The example of the formats counts findings by their rule."""
    (folder / "tables").mkdir()
    write_parquet(folder / "tables", fedora_qa.check("late.h5", select=["clocks"], evidence=False))
    names: dict[str, object] = {}
    exec(blocks("formats.md", "python")[0], names)
    assert list(names["found"].columns)[:3] == ["file", "check", "id"]  # type: ignore[attr-defined]
