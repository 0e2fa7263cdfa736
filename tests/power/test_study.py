"""A study checks each file once, keeps what it found, and believes nothing that is out of date."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.errors import MisuseError
from fedora_qa.power import study
from fedora_qa.power.detection_power import MEASURED, estimators_digest
from fedora_qa.power.manifest import CorpusItem, Manifest
from fedora_qa.power.study import State, Trial, measured_with, run_study, state_folder
from tests.support.records import failed, file_record, late_events, passed

OPTIONS = CheckOptions()


class Checker:
    """Stands in for the checks: says of every file but clean ones that events are late, and remembers the files."""

    def __init__(self) -> None:
        self.seen: list[str] = []
        self.interrupt_at = -1

    def __call__(self, path: Path, options: CheckOptions) -> FileRun:
        if len(self.seen) == self.interrupt_at:
            raise KeyboardInterrupt
        self.seen.append(path.name)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        late = "clean" not in path.name
        record = file_record(failed(), diagnoses=(late_events(),)) if late else file_record(passed())
        return FileRun(replace(record, path=str(path), sha256=digest))


@pytest.fixture
def checker(monkeypatch: pytest.MonkeyPatch) -> Checker:
    """The checks, replaced."""
    checker = Checker()
    monkeypatch.setattr(study, "check_file", checker)
    return checker


@pytest.fixture
def corpus(tmp_path: Path) -> tuple[Path, Manifest]:
    """A corpus of one clean and three faulty files, with their digests."""
    folder = tmp_path / "corpus"
    folder.mkdir()
    items = []
    for name in ("clean.h5", "1.h5", "2.h5", "3.h5"):
        (folder / name).write_bytes(name.encode())
        digest = hashlib.sha256(name.encode()).hexdigest()
        cause = (
            {} if name == "clean.h5" else {"cause": "time_offset", "stream": "events", "magnitude": 2.0, "unit": "ms"}
        )
        items.append(CorpusItem(name, sha256=digest, **cause))  # type: ignore[arg-type]
    return folder, Manifest(1, tuple(items))


Run = Callable[..., tuple[Trial, ...]]


@pytest.fixture
def run(corpus: tuple[Path, Manifest], tmp_path: Path) -> Run:
    """Run the study, with what identifies the way of checking."""

    def run_with(manifest: Manifest = corpus[1], with_: str = "one") -> tuple[Trial, ...]:
        return run_study(manifest, State(tmp_path / "state", corpus[0], with_), OPTIONS, 1, lambda *_: None)

    return run_with


def test_keeps_what_matters_of_a_record(run: Run, checker: Checker) -> None:
    """Failed checks, readings and which of them exceed their limits, and diagnoses."""
    clean, late, *_ = run()
    assert (clean.checked.failed, [one.name for one in clean.checked.measurements]) == ((), ["backward_steps"])
    assert (list(clean.checked.exceeded), clean.checked.diagnoses) == ([], ())
    assert late.checked.failed == ("event_response.timing",)
    assert [(one.name, one.deviation) for one in late.checked.exceeded] == [("offset", 2.0634)]
    assert [one.name for one in late.checked.diagnoses] == ["events:time_offset"]


def test_an_interrupt_keeps_what_is_done(run: Run, checker: Checker) -> None:
    """Interrupted after two files, the next run checks the other two, and gives what one run would have given."""
    checker.interrupt_at = 2
    with pytest.raises(KeyboardInterrupt):
        run()
    assert checker.seen == ["clean.h5", "1.h5"]
    checker.interrupt_at = -1
    resumed = run()
    assert checker.seen == ["clean.h5", "1.h5", "2.h5", "3.h5"]
    assert resumed == run(with_="afresh")


def test_what_is_known_is_not_checked_again(run: Run, checker: Checker) -> None:
    """A second run checks nothing and finds the same."""
    assert run() == run()
    assert len(checker.seen) == 4


def test_another_way_of_checking_starts_afresh(run: Run, checker: Checker) -> None:
    """Results of other code, rules or configuration are ignored, and replaced."""
    run()
    run(with_="two")
    assert len(checker.seen) == 8


def test_another_file_is_checked_again(run: Run, checker: Checker, corpus: tuple[Path, Manifest]) -> None:
    """Where the manifest lists another digest, that file alone is checked again."""
    run()
    folder, manifest = corpus
    (folder / "2.h5").write_bytes(b"other")
    other = replace(manifest.items[2], sha256=hashlib.sha256(b"other").hexdigest())
    run(replace(manifest, items=(*manifest.items[:2], other, *manifest.items[3:])))
    assert checker.seen[4:] == ["2.h5"]


def test_damaged_results_are_made_anew(run: Run, checker: Checker, tmp_path: Path) -> None:
    """A result that cannot be read is no result."""
    run()
    (tmp_path / "state" / "1.h5.json").write_text("{")
    assert run() == run()
    assert checker.seen[4:] == ["1.h5"]


def test_a_file_that_is_not_the_listed_one(run: Run, checker: Checker, corpus: tuple[Path, Manifest]) -> None:
    """A file whose content has another digest than the manifest says is misuse."""
    (corpus[0] / "1.h5").write_bytes(b"damaged")
    with pytest.raises(MisuseError, match=r"Expected 1\.h5 with the SHA-256"):
        run()


def test_state_lies_beside_the_corpus(tmp_path: Path) -> None:
    """Unless asked for, nothing is written into a corpus; of several corpora each has a folder of its own."""
    assert state_folder(tmp_path / "corpus") == tmp_path / "corpus.power"
    assert state_folder(tmp_path / "corpus", tmp_path / "kept") == tmp_path / "kept" / "corpus.power"


def test_digest_is_that_of_the_measuring_code(tmp_path: Path) -> None:
    """The digest changes with a line of an estimator, and with a file's name; not with other folders or line ends."""
    for folder in (*MEASURED, "cli"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "one.py").write_text("x = 1\n")
    before = estimators_digest(tmp_path)
    (tmp_path / "cli" / "one.py").write_text("x = 2\n")
    (tmp_path / "checks" / "one.py").write_bytes(b"x = 1\r\n")
    assert estimators_digest(tmp_path) == before
    (tmp_path / "checks" / "one.py").rename(tmp_path / "checks" / "two.py")
    renamed = estimators_digest(tmp_path)
    (tmp_path / "estimators" / "one.py").write_text("x = 2\n")
    assert len({before, renamed, estimators_digest(tmp_path)}) == 3


def test_the_configuration_is_part_of_the_way_of_checking() -> None:
    """Two configurations are two ways of checking."""
    assert measured_with("a") != measured_with("b") == measured_with("b")
