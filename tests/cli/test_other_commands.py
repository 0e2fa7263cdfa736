"""``report``, ``stats``, ``checks``, ``explain``, ``layout``, ``doctor``."""

import io
import json
import sys
import tomllib
from pathlib import Path

import h5py
import pytest
from rich.console import Console

from fedora_qa.causes import CAUSES
from fedora_qa.cli import doctor as doctor_module
from fedora_qa.cli.console import print_table
from fedora_qa.cli.doctor import Symptom
from fedora_qa.cli.progress import files_progress, progress_bar
from fedora_qa.engine.progress import ProgressTally
from fedora_qa.record.tables import TextTable
from tests.cli.conftest import Command
from tests.support.all_checks import CHECKS
from tests.support.graphics import without_opengl
from tests.support.latex_reader import read_latex

TIMESTAMPS = ("--select", "clocks")


def test_report_shows_what_check_showed(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A record renders again without the data: the same terminal text and the same markdown."""
    checked = fedora_qa(
        "check", *TIMESTAMPS, sequence, "--json", tmp_path / "out.json", "--markdown", tmp_path / "one.md"
    )
    sequence.unlink()
    reported = fedora_qa("report", tmp_path / "out.json", "--markdown", tmp_path / "two.md")
    assert reported.code == 0
    assert reported.out == checked.out
    assert (tmp_path / "one.md").read_text() == (tmp_path / "two.md").read_text()


def test_report_of_what_is_no_record(fedora_qa: Command, sequence: Path) -> None:
    """An HDF5 file given as a record is misuse."""
    done = fedora_qa("report", sequence)
    assert done.code == 2
    assert "record" in done.err


def test_checks_when_piped(fedora_qa: Command) -> None:
    """Piped, each line is a name, a tab and a question, in the order of the run."""
    rows = [line.split("\t") for line in fedora_qa("checks").out.splitlines()]
    assert [name for name, _ in rows] == [check.name for check in CHECKS]
    assert all(question.endswith("?") for _, question in rows)


def test_explain_tells_the_whole_text(fedora_qa: Command) -> None:
    """``explain`` shows the check's question, what it needs, and its description."""
    done = fedora_qa("explain", "clocks.order")
    assert done.code == 0
    check = next(check for check in CHECKS if check.name == "clocks.order")
    assert check.question in done.out
    assert "needs:" in done.out
    assert len(done.out.splitlines()) > 4


def test_explain_a_cause(fedora_qa: Command) -> None:
    """As the summary names it, with its stream, or without; a misspelt one is answered with the nearest."""
    done = fedora_qa("explain", "events:time_offset")
    assert (done.code, done.out) == (0, fedora_qa("explain", "time_offset").out)
    for words in ("Timestamps are late by a constant.", "In ms; positive means", CAUSES["time_offset"].remedy):
        assert words in done.out
    assert fedora_qa("explain", "time_ofset").err.endswith("did you mean 'time_offset'?\n")
    assert fedora_qa("explain", "flow/10hz:time_offset").code == 0
    misspelt = fedora_qa("explain", "event:time_offset")
    assert misspelt.code == 2
    assert "Expected a stream of time_offset (rgb, depth, events, imu, pose, flow), got 'event'" in misspelt.err


def test_explain_the_code_of_a_finding(fedora_qa: Command) -> None:
    """The check that reports it."""
    done = fedora_qa("explain", "clocks.order.backward_steps")
    assert done.code == 0
    first, _, rest = done.out.partition("\n\n")
    assert first == "clocks.order.backward_steps is a rule or a measurement of the check clocks.order."
    assert rest == fedora_qa("explain", "clocks.order").out


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gaps", "did you mean 'clocks.gaps' or 'event_stream.gaps'?"),
        ("gap", "did you mean 'clocks.gaps' or 'event_stream.gaps'?"),
        ("clocks.rates", "did you mean 'clocks.rate'?"),
        ("F3", "which numbers a finding or diagnosis of one record; use the code beside it"),
        ("zzz", "`fedora-qa checks` and `fedora_qa.explain()` list them\n"),
    ],
)
def test_explain_lists_what_is_near(fedora_qa: Command, name: str, words: str) -> None:
    """Checks of a property, the nearest name, or where names are listed."""
    done = fedora_qa("explain", name)
    assert (done.code, words in done.err) == (2, True)


def test_explain_a_subject(fedora_qa: Command) -> None:
    """The name of a subject explains each of its checks."""
    done = fedora_qa("explain", "clocks")
    assert all(check.name in done.out for check in CHECKS if check.name.startswith("clocks."))


def test_stats_tables(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """The tables name the file and its numbers; JSON, markdown and LaTeX hold the same."""
    outputs = ("--json", tmp_path / "out.json", "--markdown", tmp_path / "out.md", "--latex", tmp_path / "out.tex")
    done = fedora_qa("stats", sequence, *outputs)
    assert done.code == 0
    for title in ("Sequences", "Flow", "Depth and light", "Rates"):
        assert title in done.out
        assert f"## {title}" in (tmp_path / "out.md").read_text(encoding="utf-8")
    (file,) = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["files"]
    assert file["path"] == str(sequence)
    assert file["statistics"]["motion"]["distance_m"] == pytest.approx(0.0, abs=1e-9)
    assert file["statistics"]["depth"]["min_m"] == 5.0
    printed = fedora_qa("stats", sequence, "--format", "latex")
    titles = [table.caption.partition(".")[0] for table in read_latex(printed.out)]
    assert titles == ["Sequences", "Flow", "Depth and light", "Rates"]
    assert (printed.out, printed.err) == ((tmp_path / "out.tex").read_text(encoding="utf-8"), done.out)


def test_stats_of_a_truncated_file(fedora_qa: Command, sequence: Path) -> None:
    """A file that cannot be opened has no statistics: that is a finding, said in one sentence."""
    sequence.write_bytes(sequence.read_bytes()[:5000])
    done = fedora_qa("stats", sequence)
    assert done.code == 1
    assert done.err.count("\n") == 1


def test_layout(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """``layout`` says where everything lies, what is absent, and drafts a dialect that is TOML."""
    with h5py.File(sequence, "r+") as file:
        del file["path/imu"]
    done = fedora_qa("layout", sequence, "--draft-dialect", tmp_path / "mine.toml")
    assert done.code == 0
    assert "path/events/t" in done.out
    assert "imu: there is no" in done.out
    assert tomllib.loads((tmp_path / "mine.toml").read_text(encoding="utf-8"))["name"] == "mine"


def test_a_draft_keeps_its_corrections(fedora_qa: Command, sequence: Path, tmp_path: Path) -> None:
    """A second draft needs another name; a draft states how much was guessed."""
    draft = tmp_path / "mine.toml"
    assert "is written, with" in fedora_qa("layout", sequence, "--draft-dialect", draft).out
    draft.write_text("corrected")
    done = fedora_qa("layout", sequence, "--draft-dialect", draft)
    assert done.code == 2
    assert "it may hold corrections" in done.err
    assert draft.read_text() == "corrected"


def test_layout_says_that_no_dialect_fits(fedora_qa: Command, tmp_path: Path) -> None:
    """As ``check`` does."""
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["weights"] = [1.0, 2.0]
    assert "layout not recognised" in fedora_qa("layout", tmp_path / "other.h5").out


@pytest.mark.parametrize("command", [("check",), ("layout",), ("stats",), ("import", "-o", "out.h5")])
def test_events_as_text_are_answered_with_the_folder(
    fedora_qa: Command, tmp_path: Path, command: tuple[str, ...]
) -> None:
    """A dialect of a folder reads their columns."""
    events = tmp_path / "events.txt"
    events.write_text("0.001 3 4 1\n0.002 5 6 0\n", "utf-8")
    done = fedora_qa(*command, events)
    assert done.code == 2
    assert f"got a text file ({'by' if command[0] == 'import' else 'no'}" in done.err
    assert done.err.endswith("draft a dialect with `fedora-qa layout FOLDER --draft-dialect mine.toml`\n")


def test_layout_in_a_narrow_terminal(fedora_qa: Command, sequence: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every path stays whole in 60 columns."""
    monkeypatch.setenv("COLUMNS", "60")
    lines = fedora_qa("layout", sequence).out.splitlines()
    assert max(map(len, lines)) <= 60
    assert any(line.startswith("path/imu/linear_acceleration ") for line in lines)


def test_layout_shows_hostile_names_as_they_are(fedora_qa: Command, tmp_path: Path) -> None:
    """The name of a dataset is neither markup nor an escape sequence."""
    with h5py.File(tmp_path / "odd.h5", "w") as file:
        file["[bold]odd"] = [1, 2]
        file["turns\x1b[31mred"] = [1, 2]
    done = fedora_qa("layout", tmp_path / "odd.h5")
    assert done.code == 0
    assert "[bold]odd" in done.out
    assert "\x1b" not in done.out


def test_doctor(fedora_qa: Command, opengl: str) -> None:
    """On a machine that draws the doctor finds the codec, OpenCV and every library, and says what drew."""
    done = fedora_qa("doctor")
    assert done.code == 0
    for part in ("HDF5 Blosc-Zstd", "OpenCV remap", "numpy", "cores", "memory", "HTML report", "Checks can run."):
        assert part in done.out
    rows = {line.split("  ")[0]: line for line in done.out.splitlines()}
    assert opengl in rows["mesh scenes"]
    assert " ok " in rows["trajectory render"]


def test_doctor_without_opengl(fedora_qa: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where OpenGL cannot be loaded the doctor names the packages and what lacks them; checks can still run."""
    for name, value in without_opengl(tmp_path).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("COLUMNS", "400")
    done = fedora_qa("doctor")
    assert done.code == 0
    rows = {line.split("  ")[0]: line for line in done.out.splitlines()}
    for row in ("trajectory render", "mesh scenes"):
        assert " missing " in rows[row]
        assert "libegl1" in rows[row]
        assert "libgl1-mesa-dri" in rows[row]
        assert "No check needs it" in rows[row]


def test_doctor_without_the_extras(fedora_qa: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where the libraries of the extras are missing the doctor names the extras, not packages of the system."""
    (tmp_path / "pyrender.py").write_text("raise ModuleNotFoundError(\"No module named 'pyrender'\")\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "fedora_reports.trajectory", None)
    monkeypatch.setattr(doctor_module, "package_version", lambda name: None if name == "jinja2" else "1.0")
    monkeypatch.setenv("COLUMNS", "400")
    done = fedora_qa("doctor")
    assert done.code == 0
    rows = {line.split("  ")[0]: line for line in done.out.splitlines()}
    assert "fedora-qa[generator]" in rows["mesh scenes"]
    assert "fedora-qa[reports]" in rows["trajectory render"]
    assert "fedora-qa[reports]" in rows["HTML report"]


def test_doctor_on_a_sick_machine(fedora_qa: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is needed and broken exits with 3; what only pictures need does not."""
    symptoms = [Symptom("mesh scenes", "missing", "apt install libegl1", needed=False)]
    monkeypatch.setattr(doctor_module, "examine", lambda: iter(symptoms))
    assert fedora_qa("doctor").code == 0
    symptoms.append(Symptom("HDF5 Blosc-Zstd", "broken", "no filter"))
    done = fedora_qa("doctor")
    assert done.code == 3
    assert "Checks cannot run" in done.out


def test_progress_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bar is drawn where stderr is a terminal, and nothing where it is not."""
    for terminal in (True, False):
        buffer = io.StringIO()
        console = Console(file=buffer, force_terminal=terminal, width=80)
        monkeypatch.setattr("fedora_qa.cli.progress.stderr_console", lambda console=console: console)
        with progress_bar("[red]seq.h5") as report:
            report("measuring", 1, 2)
        assert ("[red]seq.h5: measuring" in buffer.getvalue()) == terminal


def test_no_bar_before_its_total(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bar of a run appears with its first report, which states how many bytes there are."""
    buffer = io.StringIO()
    console = Console(file=buffer, force_terminal=True, width=80)
    monkeypatch.setattr("fedora_qa.cli.progress.stderr_console", lambda: console)
    with files_progress(0) as report:
        console.print("before")
        report(ProgressTally("measuring", 0, 2, 1, 4, 1000, 4000))
    before, after = buffer.getvalue().split("before", maxsplit=1)
    assert "━" not in before
    assert "1.0/4.0 kB" in after


def test_units_stand_below_names_in_a_narrow_terminal() -> None:
    """A table that is too wide breaks its head before the units, not within a name."""
    table = TextTable("Rates", ("sequence", *(f"flow/{rate}hz [Hz]" for rate in (10, 25, 50))), (("a", "1", "2", "3"),))
    console = Console(width=44, record=True, file=io.StringIO())
    print_table(console, table)
    lines = console.export_text().splitlines()
    assert lines[1].split() == ["flow/10hz", "flow/25hz", "flow/50hz"]
    assert lines[2].split() == ["sequence", "[Hz]", "[Hz]", "[Hz]"]


def test_rows_are_listed_where_no_table_fits() -> None:
    """Where the longest words do not fit beside each other, each row names its cells that have a value."""
    table = TextTable("Rates", ("sequence", *(f"flow/{rate}hz [Hz]" for rate in (10, 25, 50))), (("a", "1", "-", "3"),))
    console = Console(width=30, record=True, file=io.StringIO())
    print_table(console, table)
    assert console.export_text().split() == ["Rates", "a", "flow/10hz", "[Hz]", "1;", "flow/50hz", "[Hz]", "3"]
