"""What a pass is worth stands in the report, as it was handed in, with what came of each check here."""

from dataclasses import replace

from fedora_reports.detection_power import DetectableCause, PassDetectionPower, detection_power_rows, pass_limits_of
from fedora_reports.html import render_html
from fedora_reports.problems import Link
from tests.reports.page_reader import complaints_about, read_page
from tests.support.records import failed, file_record, not_observable, passed, record

WORTH = PassDetectionPower(
    (
        DetectableCause("rgb:unsorted", "clocks.order", "found 13 of 13 (100.0%)", best=True),
        DetectableCause("imu:time_offset", "imu.timing", "95% at 3.2 (2 to 5) ms", best=True),
        DetectableCause("imu:time_offset", "clocks.order", "95% at 900 (700 to ?) ms", best=False),
        DetectableCause("pose:teleport", "pose.continuity", "95% at 1 (0.5 to 2) m", best=True),
    ),
    "Over 2501 short and small files.",
)


def test_rows_are_of_the_best_checks_that_were_run() -> None:
    """A fault whose best check was not run has no row; the outcome says whether it was looked for here."""
    results = (passed(), failed(), not_observable())
    rows = detection_power_rows(WORTH, results, ("a", "b", "c"))
    assert [(row.cause, row.check, row.anchor, row.outcome_word) for row in rows] == [
        ("rgb:unsorted", "clocks.order", "a", "passed"),
        ("imu:time_offset", "imu.timing", "c", "not observable"),
    ]


def test_page_says_what_a_pass_is_worth_and_whence_that_is_known() -> None:
    """The table, the sentence of where it was measured, and all that a check finds beside the check."""
    page = read_page(render_html(record(file_record(passed(), not_observable())), {}, WORTH))
    assert complaints_about(page) == []
    (section,) = page.all("section", kind="worth")
    assert "Over 2501 short and small files." in section.text
    assert "95% at 3.2 (2 to 5) ms" in section.text
    order = next(one for one in page.all("details", kind="check") if one.attributes["data-name"] == "clocks.order")
    assert "rgb:unsorted found 13 of 13 (100.0%); imu:time_offset 95% at 900 (700 to ?) ms." in order.text


def test_without_a_table_nothing_is_claimed_of_other_files() -> None:
    """Where no study is published the section states the limits of this file alone; without a pass it is left out."""
    page = read_page(render_html(record(file_record(passed())), {}))
    (section,) = page.all("section", kind="worth")
    assert "other files" not in section.text
    assert not read_page(render_html(record(file_record(failed())), {})).all("section", kind="worth")


def test_limits_are_those_of_the_file() -> None:
    """Of passed checks alone: what would have been seen, with its unit; exact ones and those silent apart."""
    measured = [replace(failed().measurements[1], name=f"m{k}", least_detectable=0.1 * k) for k in range(1, 6)]
    timing = replace(failed(), outcome="passed", findings=(), measurements=tuple(measured))
    limits = pass_limits_of((timing, passed(), not_observable()), ("a", "b", "c"))
    assert limits is not None
    (row,) = limits.rows
    assert (row.check, row.limit, row.more) == (Link("a", timing.check), "m1 ≥ 0.1 ms", 4)
    assert limits.exact == (Link("b", "clocks.order"),)
    assert limits.unobserved == ((Link("c", "imu.timing"), "the vehicle hovers"),)
    assert pass_limits_of((failed(), not_observable()), ("a", "b")) is None
