"""``fedora-generate`` as a person or a script meets it: output, exit codes, one line for an error."""

import sys
from pathlib import Path

import h5py
import pytest

from fedora_generator.choices import SCENE_NAMES
from fedora_generator.cli import COMMANDS, main


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Exit code of the program."""
    monkeypatch.setattr(sys, "argv", ["fedora-generate", *arguments])
    monkeypatch.setattr("signal.signal", lambda *_: None)  # the test run keeps its own handlers
    try:
        main()
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def test_scenes_are_listed_name_first_without_a_header(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``fedora-generate scenes | head -1 | cut -d ' ' -f 1`` is a scene with every stream."""
    assert run(monkeypatch, "scenes") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(SCENE_NAMES)
    assert all(len(line.split()) > 3 for line in lines)


def test_a_sequence_is_written_and_summed_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit 0, the file with what was asked for, one line on stderr, nothing on stdout, no progress without terminal."""
    target = tmp_path / "seq.h5"
    options = ("--duration", "0.06", "--size", "72x54", "--streams", "rgb,events", "--quality", "draft", "--seed", "7")
    assert run(monkeypatch, "sequence", "park-day", "-o", str(target), *options) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    with h5py.File(target) as file:
        assert file["path/rgb"].shape == (4, 54, 72, 3)
        assert (file["metadata/cameras/events"].attrs["width"], file.attrs["seed"]) == (32, 7)
        assert set(file["path"]) == {"rgb", "rgb_ts", "events"}
        assert f"4 frames, {len(file['path/events/t'])} events" in captured.err


def test_a_flight_with_an_end_is_written_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a duration: what is left of the flight from the start on; two seconds where it has no end."""
    for scene, start, seconds in (("racetrack-day", "111.5", 0.494), ("hover", "7", 2.0)):
        target = tmp_path / f"{scene}.h5"
        assert run(monkeypatch, "sequence", scene, "-o", str(target), "--start", start, "--streams", "imu") == 0
        with h5py.File(target) as file:
            timestamps_us = file["path/imu/ts"][:]
        assert timestamps_us[0] == 0
        assert timestamps_us[-1] == pytest.approx(1e6 * seconds, abs=2000)


def test_force_replaces_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without it the file stays and the exit code is 2."""
    target = tmp_path / "seq.h5"
    target.write_text("precious")
    command = ("sequence", "hover", "-o", str(target), "--duration", "0.02", "--streams", "imu")
    assert run(monkeypatch, *command) == 2
    assert "exists" in capsys.readouterr().err
    assert target.read_text() == "precious"
    assert run(monkeypatch, *command, "--force") == 0
    assert h5py.is_hdf5(target)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "Missing command"),
        (("frobnicate",), "No such command 'frobnicate'"),
        (("sequense",), "did you mean 'sequence'?"),
        (("sequence", "park-dy", "-o", "{target}"), "did you mean 'park-day'?"),
        (("sequence", "park-day"), "Missing option '-o'"),
        (("sequence", "moon", "-o", "{target}"), "Expected one of the scenes park-day"),
        (("sequence", "park-day", "-o", "{target}", "--size", "720"), "such as 720x540, got '720'"),
        (("sequence", "park-day", "-o", "{target}", "--size", "0x54"), "at least 1x1 pixels, got 0x54"),
        (("sequence", "park-day", "-o", "{target}", "--size", "1x1"), "leaves the event camera a pixel"),
        (("sequence", "park-day", "-o", "{target}", "--streams", "rgb,sonar"), "got sonar"),
        (("sequence", "park-day", "-o", "{target}", "--streams", "evnts"), "did you mean 'events'?"),
        (("fault", "{target}"), "Missing argument 'CAUSE'. Try `fedora-generate fault -h`"),
        ((), "Missing command. Try `fedora-generate -h`"),
        (("sequence", "park-day", "-o", "{target}", "--duration", "-1"), "Expected a duration above 0"),
        (("sequence", "park-day", "-o", "{target}", "--duration", "300"), "got inside 'pavilion'"),
        (("sequence", "park-day", "-o", "{target}", "--start", "-1"), "Expected start_s >= 0, got -1"),
        (("sequence", "racetrack-day", "-o", "{target}", "--start", "200"), "end of the flight at 111.994 s, got"),
        (("sequence", "park-day", "-o", "{target}", "--quality", "best"), "'best' is not one of"),
        (("sequence", "park-day", "-o", "{target}", "--seed", "-3"), "-3 is not in the range"),
        (("sequence", "park-day", "-o", "{target}/no/seq.h5"), "Expected an existing folder"),
    ],
)  # fmt: skip
def test_misuse_is_one_line_and_exit_code_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    message: str,
) -> None:
    """What was expected and what was got, on stderr; nothing is written."""
    target = str(tmp_path / "seq.h5")
    assert run(monkeypatch, *(argument.format(target=target) for argument in arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert message in captured.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_is_short_or_long(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """``-h`` is ``--help``, of the program and of each command."""
    helps = []
    for option in ("-h", "--help"):
        assert run(monkeypatch, *filter(None, (name, option))) == 0
        helps.append(capsys.readouterr().out)
    assert helps[0] == helps[1]
    assert "Usage: fedora-generate" in helps[0]


COMPLETED = {
    "scenes, or a file": ("sequence park-mesh", {"plain,park-mesh-day", "plain,park-mesh-night", "file,park-mesh"}),
    "causes": ("fault a.h5 time_", {"plain,time_offset", "plain,time_jitter", "plain,time_unit"}),
    "streams that the cause befalls": (
        "fault a.h5 noise_misdeclared --stream ",
        {"plain,imu", "plain,pose", "plain,events"},
    ),
    "the last scene of a list": ("corpus --scenes hover,fast", {"plain,hover,fast-turn"}),
    "the last cause of a list": ("corpus --causes mirrored,telep", {"plain,mirrored,teleport"}),
}


@pytest.mark.parametrize(("words", "answered"), COMPLETED.values(), ids=COMPLETED.keys())
def test_shells_complete_names(
    words: str, answered: set[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Names of scenes, causes and streams are offered where they can stand."""
    whole = f"fedora-generate {words}"
    monkeypatch.setenv("_FEDORA_GENERATE_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", whole)
    monkeypatch.setenv("COMP_CWORD", str(len(whole.split(" ")) - 1))
    assert run(monkeypatch) == 0
    assert set(capsys.readouterr().out.splitlines()) == answered


def test_an_interrupt_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C while frames are written: exit 130, one line, no file."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fedora_generator.streams.FrameRenderer.render", interrupt)
    assert run(monkeypatch, "sequence", "hover", "-o", str(tmp_path / "seq.h5"), "--size", "72x54") == 130
    assert "no file was left that is not whole" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_memory_that_runs_out_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the estimate was too low after all: exit 2, no traceback, no file."""

    def run_out(*_: object) -> None:
        raise MemoryError("Unable to allocate 9 GiB")

    monkeypatch.setattr("fedora_generator.streams.FrameRenderer.render", run_out)
    assert run(monkeypatch, "sequence", "hover", "-o", str(tmp_path / "seq.h5"), "--size", "72x54") == 2
    assert "Unable to allocate 9 GiB" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
