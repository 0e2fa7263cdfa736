"""Comparisons of imaginary subjects: designs, shared rate, what differs, and how it is written."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import given as examples
from scipy.stats import binom, norm

from fedora_qa.comparison.compare import allowed_shift, compare, count_with_errors, record_changes, statistic_changes
from fedora_qa.comparison.subjects import SubjectInput, design_of, labels
from fedora_qa.comparison.tables import comparison_to_markdown
from fedora_qa.comparison.types import COMPARISON, Comparison
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import record_from_json, record_to_json
from fedora_qa.record.types import FileRecord, Finding, Measurement, Result, Where
from fedora_reports.comparison import render_comparison
from fedora_reports.html import report_script
from tests.comparison.imaginary import given, given_file
from tests.reports.hostile_records import files as hostile_files
from tests.reports.page_reader import PageReader
from tests.support.records import failed, file_record, not_observable, passed, record

STILL, FARTHER = [2.0] * 40, [2.5] * 40


def wandering(seed: int) -> list[float]:
    """Centres that are new in every block."""
    return list(2.0 + 0.1 * np.random.default_rng(seed).standard_normal(128))


def versions() -> Comparison:
    """Two versions of two files, one of which was clean and is not; one file is gone and one new."""
    clean, faulty = file_record(passed(), path="old/a.h5"), file_record(failed(), passed(), path="new/a.h5")
    before = given("old", given_file("old/a.h5", STILL, 1, clean), given_file("old/b.h5", STILL, 2),
                   given_file("old/gone.h5", STILL, 3))  # fmt: skip
    after = given("new", given_file("new/a.h5", FARTHER, 4, faulty), given_file("new/b.h5", STILL, 5),
                  given_file("new/came.h5", STILL, 6))  # fmt: skip
    return compare([before, after], None, 0.01)


def test_designs_follow_from_names() -> None:
    """Files of the same names are versions; two files are sequences; else datasets."""
    one, other = given_file("x/a.h5", STILL), given_file("y/b.h5", STILL)
    assert design_of(given("x", one), given("y", replace(one, path="y/a.h5"))) == "versions"
    assert design_of(given("x", one), given("y", other)) == "sequences"
    assert design_of(given("x", one), given("y", other, replace(other, path="y/c.h5"))) == "datasets"


def test_versions_tell_what_changed() -> None:
    """The file that moved differs, the other does not; findings and files that came and went are named."""
    pair = versions().pairs[0]
    assert pair.versions is not None
    assert [(one.file, one.told) for one in pair.differences] == [("a.h5", "differs"), ("b.h5", "no_difference_seen")]
    farther = pair.differences[0]
    assert farther.shift_standard_error is not None
    expected = (np.exp(2.5) - np.exp(2.0)) * np.exp(0.3**2 / 2)
    assert farther.distance == pytest.approx(expected, rel=0.03)
    assert farther.mean_after - farther.mean_before == pytest.approx(farther.distance, rel=1e-3)
    assert (pair.versions.gone, pair.versions.new) == (("gone.h5",), ("came.h5",))
    assert (pair.versions.matched, pair.versions.checked) == (2, 1)
    assert [one.change for one in pair.versions.findings] == ["new", "new"]


def test_what_is_the_same_to_the_last_count_is_identical() -> None:
    """However short the files are: nothing has to be told from chance."""
    one = given_file("old/a.h5", STILL[:2])
    found = compare([given("old", one), given("new", replace(one, path="new/a.h5"))], None, 0.01)
    assert [(d.told, d.distance, d.reason) for d in found.pairs[0].differences] == [("identical", 0.0, "")]


def test_two_sequences_of_the_same_counts_are_identical() -> None:
    """Too few segments to tell anything from chance are no reason to doubt that nothing differs."""
    found = compare(
        [given("one", given_file("a.h5", STILL[:2])), given("two", given_file("b.h5", STILL[:2]))], None, 0.01
    )
    assert found.pairs[0].design == "sequences"
    assert [(d.told, d.distance, d.reason) for d in found.pairs[0].differences] == [("identical", 0.0, "")]


def test_all_comparisons_share_one_rate() -> None:
    """Two distributions and two distances with errors are four tests, each at a fourth of the rate."""
    found = versions()
    assert (found.tests, found.level) == (4, pytest.approx(0.0025))


def test_two_halves_of_one_process_do_not_differ() -> None:
    """Of halves of 40 sequences, no more are told from each other than the rate allows; another depth is."""
    told = []
    for seed in range(40):
        centres = wandering(seed)
        halves = [given(f"{k}", given_file(f"{k}.h5", centres[64 * k : 64 * k + 64], 100 * k + seed)) for k in (0, 1)]
        told.append(compare(halves, None, 0.01).pairs[0].differences[0].told)
    assert binom.sf(told.count("differs") - 1, len(told), 0.01) > 1e-3
    assert told.count("no_difference_seen") >= 36
    far = given("far", given_file("far.h5", [1.0 + centre for centre in wandering(41)]))
    near = given("near", given_file("near.h5", wandering(42)))
    assert compare([near, far], None, 0.01).pairs[0].differences[0].told == "differs"


def test_datasets_are_told_by_their_files() -> None:
    """Eight files against eight can tell; three against three say how many it takes."""
    near, far = (
        [given_file(f"{name}/{name}{k}.h5", [centre] * 4, k) for k in range(8)]
        for name, centre in (("n", 2.0), ("f", 3))
    )
    assert compare([given("n", *near), given("f", *far)], None, 0.01).pairs[0].differences[0].told == "differs"
    few = compare([given("n", *near[:3]), given("f", *far[:3])], None, 0.01).pairs[0].differences[0]
    assert (few.told, few.units, few.chance) == ("not_told", (3, 3), None)
    assert few.reason == "only 3 and 3 files have it; to tell at 0.01 takes 5 each"


def test_what_cannot_be_compared() -> None:
    """One subject is misuse, and so are versions without a file in common; files without distributions are noted."""
    one = given("x", given_file("x/a.h5", STILL), given_file("x/c.h5", STILL))
    other = given("y", given_file("y/b.h5", STILL))
    with pytest.raises(MisuseError, match="two or more"):
        compare([one], None, 0.01)
    with pytest.raises(MisuseError, match="versions of the same files"):
        compare([one, other], "versions", 0.01)
    bare = given("z", replace(other.files[0], path="z/z.h5", sampled=None))
    found = compare([other, bare], None, 0.01)
    assert not found.pairs[0].differences
    assert "z.h5" in found.notes[0]


def test_document_survives_and_fits_its_schema() -> None:
    """Written and read it is the same; other documents are refused."""
    found = versions()
    text = COMPARISON.to_json(found)
    assert COMPARISON.from_json(text) == found
    jsonschema.validate(json.loads(text), COMPARISON.schema())
    for bad in ("", "[]", '{"comparison_version": "0"}', '{"comparison_version": "1.0"}'):
        with pytest.raises(MisuseError, match="Expected"):
            COMPARISON.from_json(bad)


def test_every_output_says_the_same() -> None:
    """Markdown and HTML name the new finding, the distance and the published rows."""
    found = versions()
    html, markdown = render_comparison(found), comparison_to_markdown(found).replace("\\", "")
    for page in (html, markdown):
        assert "1 differs" in page.replace("<wbr>", "")
        assert failed().findings[0].message in page
        assert "594.87" in page
        assert "45.1552" not in page
    reader = PageReader()
    reader.feed(html)
    reader.close()
    assert [one.tag for one in reader.elements].count("script") == html.count(report_script()) == 1


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@examples(hostile_files, hostile_files)
def test_hostile_records_are_shown_as_text(one: FileRecord, other: FileRecord) -> None:
    """Whatever a record holds, the outputs are made, and nothing in it becomes markup."""
    read = record_from_json(record_to_json(record(one, other))).files
    pair = [
        SubjectInput(f"<i>{k}", (replace(given_file("a.h5", STILL[:6], record=file), statistics=file.statistics),))
        for k, file in enumerate(read)
    ]
    found = compare(pair, "versions", 0.01)
    reader = PageReader()
    reader.feed(render_comparison(found))
    reader.close()
    tags = [element.tag for element in reader.elements]
    assert (tags.count("script"), tags.count("img"), tags.count("i")) == (1, 0, 0)
    assert "<i>0" not in comparison_to_markdown(found)


def test_short_names() -> None:
    """As much of a path as tells it from the others."""
    assert labels(["v1/day.h5", "v2/day.h5", "x/ngt.h5"]) == ("v1/day.h5", "v2/day.h5", "ngt.h5")
    assert labels(["/a", "b"]) == ("a", "b")


CLEAN = replace(failed(), outcome="passed", findings=(), measurements=(failed().measurements[0],))
NAME = "seq.h5"


def moved(by: float) -> Result:
    """The failed check, whose offset of 2.0634 +/- 0.031 ms with a limit of 0.16 ms has moved."""
    threshold, offset = failed().measurements
    assert offset.value is not None
    return replace(failed(), measurements=(threshold, replace(offset, value=offset.value + by)))


def test_new_and_gone() -> None:
    """What only the later version has is new, what only the earlier one has is gone, with severity and message."""
    clean, faulty = file_record(CLEAN), file_record(failed())
    forth, back = record_changes(NAME, clean, faulty), record_changes(NAME, faulty, clean)
    assert [(one.change, one.severity_before, one.severity_after) for one in forth.findings] == [
        ("new", None, "error"),
        ("new", None, "warning"),
    ]
    assert [one.change for one in back.findings] == ["gone", "gone"]
    assert back.findings[0].message_before == forth.findings[0].message_after == failed().findings[0].message
    assert [(one.before, one.after) for one in forth.outcomes] == [("passed", "failed")]


def test_findings_stay_while_their_check_measures_the_same() -> None:
    """Within the limits of both it is unchanged; beyond them it has changed, and so has the value."""
    limit = allowed_shift(failed().measurements[1], failed().measurements[1])
    assert limit == pytest.approx(0.16 * 2**0.5)
    still = record_changes(NAME, file_record(failed()), file_record(moved(0.99 * limit)))
    assert (still.findings, still.unchanged, still.measurements) == ((), 2, ())
    other = record_changes(NAME, file_record(failed()), file_record(moved(1.01 * limit)))
    assert [one.change for one in other.findings] == ["changed", "changed"]
    assert [(one.name, one.allowed) for one in other.measurements] == [("offset", pytest.approx(limit))]


def test_a_second_finding_of_one_rule_is_new() -> None:
    """Findings of one rule and stream are told apart by their order; another stream is another finding."""
    one = failed()
    more = replace(
        one,
        findings=(
            *one.findings,
            Finding("F3", one.findings[0].code, "error", "Again.", Where(stream="events")),
            Finding("F4", one.findings[0].code, "error", "Elsewhere.", Where(stream="rgb")),
        ),
    )
    found = record_changes(NAME, file_record(one), file_record(more))
    assert [(change.change, change.stream) for change in found.findings] == [("new", "events"), ("new", "rgb")]
    assert found.unchanged == 2


def test_only_the_side_that_counts_moves() -> None:
    """A value far below what is expected is as good as any other where only greater ones count."""
    quiet = Measurement("noise", 0.1, "DN", 0.1, 1.0, 0.5, 0.6, side="upper")
    results = [replace(passed(), measurements=(replace(quiet, value=value),)) for value in (0.1, 0.9, 3.0)]
    records = [file_record(result) for result in results]
    assert not record_changes(NAME, records[0], records[1]).measurements
    assert len(record_changes(NAME, records[0], records[2]).measurements) == 1


def test_what_could_not_be_told_does_not_move() -> None:
    """A check that sees nothing has an outcome of its own, and no values to compare."""
    found = record_changes(NAME, file_record(passed("imu.timing")), file_record(not_observable()))
    assert [(one.before, one.after) for one in found.outcomes] == [("passed", "not_observable")]
    assert not found.measurements


def test_statistics_move_beyond_their_error() -> None:
    """Their chance is that of a normal deviate; without an error on both sides nobody can tell."""
    before = {
        "motion": {"distance_m": 10.0, "distance_standard_error_m": 0.3, "poses_seen": 100, "speed_max_m_s": 2.0},
        "sequence": {"duration_of": "pose", "duration_s": 2.0},
    }
    after = {
        "motion": {"distance_m": 11.0, "distance_standard_error_m": 0.4, "poses_seen": 99, "speed_max_m_s": None},
        "sequence": {"duration_of": "rgb", "duration_s": 2.0},
    }
    found = {one.statistic: one for one in statistic_changes(NAME, before, after, 0.05)}
    assert set(found) == {"motion.distance_m", "motion.poses_seen", "motion.speed_max_m_s"}
    distance = found["motion.distance_m"]
    assert (distance.moved, distance.standard_error) == ("moved", pytest.approx(0.5))
    assert distance.chance == pytest.approx(2 * norm.sf(2.0))
    assert next(iter(statistic_changes(NAME, before, after, 0.01))).moved == "within_error"
    assert {found[name].moved for name in set(found) - {"motion.distance_m"}} == {"changed"}
    assert count_with_errors(before, after) == 1
