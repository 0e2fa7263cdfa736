"""The report can be read by everybody: no rule of axe-core is broken seriously."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.browser.audit import axe_script, violations
from tests.browser.devtools import Browser
from tests.browser.sample_page import write_sample
from tests.browser.tab import Tab


@pytest.fixture(scope="module")
def script() -> str:
    """The audit."""
    return axe_script()


@pytest.fixture(scope="module")
def browser(chromium: Path) -> Iterator[Browser]:
    """A browser for all tests."""
    with Browser(chromium) as running:
        yield running


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with every kind of part."""
    return write_sample(tmp_path_factory.mktemp("audit") / "report.html")


@pytest.mark.parametrize(("width", "scheme", "look"), [(390, "light", "js"), (1200, "dark", "js"), (1200, "light", "")])
def test_report_breaks_no_rule_seriously(
    browser: Browser, page: Path, script: str, width: int, scheme: str, look: str
) -> None:
    """Phone and laptop, light and dark, as it looks with and without scripts, everything unfolded."""
    with Tab(browser, page, width=width, scheme=scheme) as tab:
        # The audit needs scripts itself, so that only the look of a page without them can be audited.
        tab.evaluate(f"document.documentElement.className = '{look}'")
        tab.evaluate("for (const part of document.querySelectorAll('details')) part.open = true")
        assert violations(tab, script) == {}


def test_the_audit_can_fail(browser: Browser, tmp_path: Path, script: str) -> None:
    """A picture without words, a field without a label and grey on grey are seen."""
    (tmp_path / "bad.html").write_text(
        "<!DOCTYPE html><html lang='en'><title>Bad</title><main><h1>Bad</h1><img src='data:,'><input>"
        "<p style='color: #bbb; background: #ccc'>pale</p></main></html>"
    )
    with Tab(browser, tmp_path / "bad.html") as tab:
        assert {"image-alt", "label", "color-contrast"} <= set(violations(tab, script))
