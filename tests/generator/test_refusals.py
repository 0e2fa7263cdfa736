"""What a newcomer may try: each is refused at once, in one line that says what is wrong, with nothing left behind."""

import os
from pathlib import Path

import pytest

from tests.generator.test_cli import run
from tests.generator.tiny_sequence import write_tiny_sequence

TINY = ("--size", "72x54", "--duration", "0.04", "--quality", "draft")

OWN_WORLD = """
[world]
name = "yard"
[world.textures.grey]
dark_rgb = [0.1, 0.1, 0.1]
light_rgb = [0.5, 0.5, 0.5]
[[world.rectangles]]
name = "ground"
center_m = [0, 0, 0]
size_m = [100, 100]
texture = "grey"
"""


def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line, said before anything is made ready to be rendered."""

    def work(*_: object, **__: object) -> None:
        raise RuntimeError("Expected a refusal before any work")

    monkeypatch.setattr("fedora_generator.generate.render_surroundings", work)
    assert run(monkeypatch, *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--streams", ""), "Expected streams among rgb, depth, events, imu, pose, flow, got none"),
        (("--streams", "rgb,imu,rbg"), "got rbg"),
        (("--duration", "0"), "Expected a duration above 0 and up to 3600 s, got 0 s"),
        (("--duration", "nan"), "got nan s"),
        (("--duration", "1e9"), "got 1e+09 s"),
        (("--duration", "1e-9"), "at least a microsecond"),
        (("--duration", "soon"), "'soon' is not a valid float"),
        (("--size", "999999x999999"), "Expected an event camera of at most 65536 columns and rows, got 444444x444444"),
        (("--size", "140000x100000"), "MB of memory, which is free, got 140000x100000 of depth, events"),
        (("--size", "1e3x1e3"), "such as 720x540, got '1e3x1e3'"),
        (("--seed", "99999999999999999999999"), "is not in the range"),
        (("--quality", "perfect"), "'perfect' is not one of"),
    ],
)  # fmt: skip
def test_an_impossible_option_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    message: str,
) -> None:
    """By what it would take, or what there is to choose from."""
    command = ("sequence", "park-day", "-o", str(tmp_path / "a.h5"), *TINY, *options)
    assert message in refused(monkeypatch, capsys, *command)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("threshold_on = 0", "Expected only known keys, got threshold_on"),
        ("[events]\nthreshold_on = 0", "Expected threshold_on to be finite and at least 1e-06, got 0.0, at events"),
        ("[events]\nthreshold_off = -0.2", "Expected threshold_off to be finite and at least 1e-06, got -0.2"),
        ("[events]\nthreshold_on = true", "Expected a number or a text, got true at events.threshold_on"),
        ("[events]\nmodel = 'sqrt'", "Expected 'log' or 'linear', got 'sqrt' at events.model"),
        ("[events]\nhot_pixel_count = 99999999", "up to the 768 pixels of the event camera, got 99999999"),
        ("[events]\nshot_rate_hz = 1e11", "lower the rates of events that nothing causes"),
        ("[events]\nleak_rate_hz = 1e11", "lower the rates of events that nothing causes"),
        ("[events]\npacket_interval_us = 9223372036854775807", "at most 1e+12, got 9.22337e+18 at events.packet_inter"),
        ("[events]\nmodel = 'linear'", "Expected event_step_us with the linear model"),
        ("event_step_us = 50000", "Expected event_step_us from 0 to 20000"),
        ("[camera]\nlens = 3", "Expected only known keys, got camera.lens; remove or correct it"),
        ("[[flight.terms]]\naxis = 'x'\namplitude = 1\nfrequency_hz = 1\nwhen = 3", "got flight.terms.0.when"),
        ("[flight]\nkind = 'hover'\nposition_m = [0, 0, 3]\n[flight.wind]\ngusty = 1", "got flight.wind.gusty"),
        (f"{OWN_WORLD}waves = 3", "got world.rectangles.0.waves"),
        (f"{OWN_WORLD}[[world.boxes]]\nname = 'b'\nround = true", "got world.boxes.0.round"),
        ("[camera]\npitch_deg = nan", "Expected a finite number of at most 1e+12, got nan at camera.pitch_deg"),
        ("[light]\nsun_elevation_deg = inf", "got inf at light.sun_elevation_deg"),
        ("[camera]\nposition_body_m = [1, 2, 3, 4]", "Expected at most 3 values, got [1, 2, 3, 4] at camera.position"),
        ("[pose]\nposition_sigma_m = 1e308", "got 1e+308 at pose.position_sigma_m"),
        ("[imu]\nrate_hz = 1e7", "Expected rate_hz above 0 and up to 10000 Hz"),
        ("[rates]\nframes_hz = 0", "Expected frames_hz above 0 and up to 10000 Hz"),
        ("[rates]\npose_hz = nan", "Expected pose_hz above 0"),
        ("[rates]\nframes_hz = 29.9701", "with 3 decimals at most, got 29.9701"),
        ("[rates]\nflow_hz = []", "Expected a rate in flow_hz, got none"),
        ("[rates]\nflow_hz = [25, 25.0]", "Expected each rate once in flow_hz, got 25, 25"),
        ("[rates]\nflow_hz = [20]", "by which the 50 Hz of depth can be divided"),
        ("[rates]\ndepth_hz = 60\nflow_hz = [25]", "by which the 60 Hz of depth can be divided"),
        ("[rates]\nflow_hz = [100]", "got 100; choose another, or raise depth_hz"),
        ("seed = 99999999999999999999999", "got 1e+23 at seed"),
        ("name = 'a/b'", "Expected a name, without a slash"),
        ("depth_range_m = [3, 1]", "Expected depth_range_m to ascend"),
        ("light = 3", "Expected a table, got 3 at light"),
        ("world = 'moon'", "Expected one of the worlds baylands, park, racetrack, speedway"),
        ("renderer = 'mesh'\nplace = { name = 'mars' }", "Expected one of the places park, racetrack, got 'mars'"),
        ("[flight]\nposition_m = [nan, 0, 2]", "Expected position_m to be finite"),
        ("[flight]\nposition_m = [14, 13, 4]", "got inside 'library' at 0 s"),
        ("[flight]\nposition_m = [0, 0, -1]", "got below 'lawn' at 0 s"),
        ("[flight]\nposition_m = [2000, 0, 2]", "got beyond the rim of the ground at 0 s"),
        ("[flight]\nvelocity_m_s = [50000, 0, 0]\nposition_m = [0, 5, 30]", "beyond the rim of the ground at 0.02 s"),
        ("[flight]\nposition_m = [0, 0, 1e9]", "got more than 1000 m above the ground at 0 s"),
        (f"{OWN_WORLD}[flight]\nposition_m = [51, 0, 2]", "got beyond the rim of the ground at 0 s"),
        ("[flight]\nkind = 'hover'\nposition_m = [0, 0, 1e6]", "got more than 1000 m above the ground"),
        ("[flight]\nkind = 'survey'\nstart_m = [0, 0, 3]\nlane_m = 1\nlanes = 1000000000\nspacing_m = 1", "up to 3600"),
        ("[flight]\nkind = 'wings'", "Expected kind to be one of waypoints, survey"),
        ("x = ", "Expected a readable TOML file"),
        ("base = 'scene.toml'", "which starts from itself"),
    ],
)  # fmt: skip
def test_an_impossible_scene_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], changes: str, message: str
) -> None:
    """With the key or the place that is wrong."""
    scene = tmp_path / "scene.toml"
    scene.write_text(changes if changes.startswith("base") else f"base = 'park-day'\n{changes}\n")
    assert message in refused(monkeypatch, capsys, "sequence", str(scene), "-o", str(tmp_path / "a.h5"), *TINY)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


def test_a_step_longer_than_the_sequence_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A fixed step that never comes to its end."""
    scene = tmp_path / "scene.toml"
    scene.write_text("base = 'park-day'\nevent_step_us = 20000\n")
    command = ("sequence", str(scene), "-o", str(tmp_path / "a.h5"), *TINY, "--duration", "0.01")
    assert "at least one event_step_us, 20000 us, got 10000 us" in refused(monkeypatch, capsys, *command)


@pytest.mark.parametrize(
    "content", [b"\x00\xff\xfe" * 100, b"", b"name = 3", b"[[", b"base = 3", "base = 'é'".encode()]
)
def test_a_file_that_is_no_scene_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], content: bytes
) -> None:
    """Binary, empty, or half of one; and files of another name, folders and devices."""
    scene = tmp_path / "scene.toml"
    scene.write_bytes(content)
    for name in (str(scene), str(tmp_path), "/dev/zero", "/dev/null", str(tmp_path / "none.toml")):
        assert "Expected" in refused(monkeypatch, capsys, "sequence", name, "-o", str(tmp_path / "a.h5"), *TINY)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


def test_a_base_beside_the_scene_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From whichever folder the command is called."""
    (tmp_path / "first.toml").write_text("base = 'hover'\nname = 'first'\n")
    (tmp_path / "second.toml").write_text("base = 'first.toml'\nseed = 3\n")
    command = ("sequence", str(tmp_path / "second.toml"), "-o", str(tmp_path / "a.h5"), *TINY, "--streams", "imu")
    assert run(monkeypatch, *command) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fault", "{clean}", "time_offset", "-o", "{out}"), "Expected a magnitude for time_offset"),
        (("fault", "{clean}", "time_offset", "--magnitude", "nan", "-o", "{out}"), "finite"),
        (("fault", "{clean}", "time_offset", "--magnitude", "inf", "-o", "{out}"), "finite"),
        (("fault", "{clean}", "no_such", "-o", "{out}"), "choose from"),
        (("fault", "{clean}", "time_ofset", "-o", "{out}"), "did you mean 'time_offset'? `fedora-generate fault -h`"),
        (("fault", "{clean}", "events:time_offset", "-o", "{out}"), "use time_offset --stream events"),
        (("fault", "{clean}", "events:time_ofset", "-o", "{out}"), "did you mean 'time_offset'?"),
        (("fault", "{clean}", "time_offset", "--magnitude", "2", "--stream", "smell", "-o", "{out}"), "choose from"),
        (("fault", "{clean}", "flow_sign", "--stream", "flow", "-o", "{clean}"), "which exists"),
        (("fault", "{clean}", "flow_sign", "--stream", "flow", "-o", "{clean}", "--force"), "other than the source"),
        (("fault", "{clean}", "flow_sign", "--stream", "flow", "-o", "{pipe}", "--force"), "a device or a pipe"),
        (("fault", "{clean}", "flow_sign", "--stream", "flow", "-o", "{out}/no/x.h5"), "Expected an existing folder"),
        (("fault", "{clean}", "index_side", "-o", "{out}"), "choose from rgb_to_event, depth_to_event"),
        (("fault", "{clean}.none", "flow_sign", "-o", "{out}"), "a path that does not exist"),
        (("fault", "{scene}", "flow_sign", "--stream", "flow", "-o", "{out}"), "got no HDF5 file"),
        (("fault", "{clean}", "hot_pixels", "--magnitude", "3", "--seed", "-1", "-o", "{out}"), "-1"),
        (("corpus", "-o", "{clean}"), "got the file"),
        (("corpus", "-o", "{out}", "--scenes", ""), "at least one scene"),
        (("corpus", "-o", "{out}", "--scenes", "park-day,moon"), "got 'moon'"),
        (("corpus", "-o", "{out}", "--causes", "gremlins"), "choose from"),
        (("corpus", "-o", "{out}", "--scenes", "hover,{scene}"), "Expected scenes of different names"),
        (("corpus", "-o", "{out}", "--duration", "nan"), "Expected a duration"),
        (("corpus", "-o", "{out}", "--size", "90000x90000", "--duration", "0.1"), "MB of memory"),
        (("corpus", "-o", "{out}", "--size", "9000x9000", "--duration", "20"), "free for the corpus"),
        (("corpus", "-o", "{clean}/no/corpus"), "Expected"),
    ],
)  # fmt: skip
def test_an_impossible_fault_or_corpus_is_refused(
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    message: str,
) -> None:
    """Before anything is made."""
    inputs = tmp_path_factory.mktemp("inputs")
    (inputs / "scene.toml").write_text("base = 'hover'\n")
    write_tiny_sequence(inputs / "clean.h5")
    places = {
        "clean": inputs / "clean.h5",
        "scene": inputs / "scene.toml",
        "pipe": inputs / "pipe",
        "out": tmp_path / "out",
    }
    os.mkfifo(places["pipe"])
    command = (argument.format(**places) for argument in arguments)
    assert message in refused(monkeypatch, capsys, *command)
    assert list(tmp_path.iterdir()) == []
    assert {path.name for path in inputs.iterdir()} == {"clean.h5", "scene.toml", "pipe"}
