"""What faults cost a learner is quoted where a check is explained: as measured, or not at all."""

from pathlib import Path

import pytest

from fedora_qa.cli.explain import explanations_of
from fedora_qa.cli.outputs import rule_helps
from fedora_qa.cli.published_studies import PRICE_TITLE, fault_price_text, fault_price_texts
from fedora_qa.errors import MisuseError
from fedora_qa.scoring.fault_prices import FaultPrice, FaultPrices, read_fault_prices, write_fault_prices
from fedora_reports.html import render_html
from tests.support.records import file_record, passed, record

CHECK = "event_response.timing"


def price(size: float, metric: str, cost: float, half: float) -> FaultPrice:
    return FaultPrice(
        "events are late", "events:time_offset", size, "ms", (CHECK,), metric, 0.45, cost, cost - half, cost + half
    )


PRICES = FaultPrices(
    date="2026-11-26",
    flights=40,
    networks=3,
    correct_networks=6,
    prices=(
        price(2, "NAEE", 0.004, 0.02),
        price(2, "NADE", 0.001, 0.01),
        price(10, "NAEE", 0.15, 0.02),
        price(10, "NADE", 0.001, 0.01),
    ),
)


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> None:
    """The prices above are those of the package."""
    monkeypatch.setattr("fedora_qa.cli.published_studies.read_fault_prices", lambda: PRICES)


def test_the_table_is_the_same_when_read_again(tmp_path: Path) -> None:
    """Without a table there are no prices; a damaged one is an error."""
    target = tmp_path / "prices.json"
    assert read_fault_prices(target) is None
    write_fault_prices(PRICES, target)
    assert read_fault_prices(target) == PRICES
    target.write_text("{")
    with pytest.raises(MisuseError, match="make study-learning"):
        read_fault_prices(target)


@pytest.mark.usefixtures("published")
def test_explain_quotes_costs() -> None:
    """A cost beyond the scatter has its interval; a size without one is not quoted."""
    text = fault_price_text(CHECK)
    assert text.startswith("events are late, 10 ms: NAEE 0.450 + 0.150 (0.130 to 0.170)\n")
    assert "2 ms" not in text
    assert "NADE" not in text
    assert "40 generated flights" in text
    (explained,) = explanations_of(CHECK)
    assert explained.sections[PRICE_TITLE] == text
    assert fault_price_texts() == {CHECK: text}


@pytest.mark.usefixtures("published")
def test_what_was_not_measured_is_not_quoted() -> None:
    """A check whose faults have no price has no section."""
    assert fault_price_text("imu.noise") == ""
    (explained,) = explanations_of("imu.noise")
    assert PRICE_TITLE not in explained.sections


@pytest.mark.usefixtures("published")
def test_rules_and_reports_quote_the_price() -> None:
    """Code scanning shows it as a part of why a check matters, the report in the details of the check."""
    assert "NAEE 0.450 + 0.150" in rule_helps()[CHECK].markdown
    checked = record(file_record(passed(CHECK)))
    page = render_html(checked, {}, fault_prices=fault_price_texts())
    assert "Why it matters to a learner: Events are late, 10 ms" in page
    assert "Why it matters to a learner" not in render_html(checked, {})
