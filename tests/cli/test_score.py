"""``fedora-qa score`` and ``fedora_qa.score``: what they say and write, and exit codes."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import fedora_qa as package
from fedora_qa.errors import MisuseError
from fedora_qa.scoring.types import SCORE
from tests.cli.conftest import Command
from tests.support.predictions import of_stream, truth, write_predictions, write_truth

FLOW = truth()["path/flow/50hz"]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """Predictions of flow, depth and pose, and their sequence."""
    sequence = write_truth(tmp_path / "seq.h5")
    flow = of_stream("flow", **{"50hz": FLOW + np.float32([0.375, 0.5])})
    predictions = flow | of_stream("depth") | of_stream("pose")
    return write_predictions(tmp_path / "predictions.h5", predictions), sequence


def test_outputs_agree(fedora_qa: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """The error stands in the terminal, in JSON on stdout that fits its schema, in markdown and on the page."""
    outputs = {kind: tmp_path / f"out.{kind}" for kind in ("html", "markdown")}
    written = (part for kind, path in outputs.items() for part in (f"--{kind}", path))
    done = fedora_qa("score", *files, *written, "--json", "-")
    assert done.code == 0
    document = json.loads(done.out)
    jsonschema.validate(document, SCORE.schema())
    assert document["flow"][0]["parts"][0]["aee_px"] == 0.625
    for text in (done.err, *(outputs[kind].read_text(encoding="utf-8") for kind in ("html", "markdown"))):
        assert "Flow at 50 Hz" in text
        assert "0.625" in text
        assert "100% covered" in text


def test_the_function_is_the_command(fedora_qa: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """It returns what the command writes, and a notebook shows the page."""
    fedora_qa("score", *files, "--json", tmp_path / "out.json")
    scored = package.score(*files)
    scored.save(tmp_path / "saved.json")
    assert (tmp_path / "saved.json").read_bytes() == (tmp_path / "out.json").read_bytes()
    assert "Flow at 50 Hz" in scored._repr_html_()
    assert "Flow at 50 Hz" in scored.light_page()
    assert "NAEE" in repr(scored)
    assert scored.tables[0].title == "Flow at 50 Hz"


def test_misuse(fedora_qa: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """Nothing there, no HDF5, truncated predictions, a wrong sequence, an output over an input: 2, in one sentence."""
    predictions, sequence = files
    text, truncated, empty = tmp_path / "text.h5", tmp_path / "truncated.h5", tmp_path / "empty"
    text.write_text("flow")
    truncated.write_bytes(predictions.read_bytes()[:3000])
    empty.mkdir()
    other = write_truth(tmp_path / "other.h5", "path/flow/50hz", "path/flow/50hz_ts", "path/flow/50hz_moving")
    for arguments, said in (
        ((tmp_path / "nowhere.h5", sequence), "Expected predictions, got a path that does not exist"),
        ((predictions, tmp_path / "nowhere.h5"), "Expected a sequence, got a path that does not exist"),
        ((text, sequence), "no HDF5 signature"),
        ((predictions, text), "no HDF5 signature"),
        ((truncated, sequence), "truncated.h5); write the predictions again"),
        ((predictions, other), "Expected flow/50hz in"),
        ((empty, sequence), "got none; write one for each interval"),
        ((predictions, sequence, "--json", predictions), "output of its own"),
        ((predictions, sequence, "--format", "dsec"), "--format dsec"),
    ):
        done = fedora_qa("score", *arguments)
        assert (done.code, said in done.err, done.err.count("\n")) == (2, True, 1), done.err
    with pytest.raises(MisuseError, match="does not exist"):
        package.score(tmp_path / "nowhere.h5", sequence)


def test_a_truncated_sequence_is_named(fedora_qa: Command, files: tuple[Path, Path], tmp_path: Path) -> None:
    """As for other commands it is a finding about the file: exit code 1."""
    truncated = tmp_path / "short.h5"
    truncated.write_bytes(files[1].read_bytes()[:3000])
    done = fedora_qa("score", files[0], truncated)
    assert done.code == 1
    assert "short.h5" in done.err
