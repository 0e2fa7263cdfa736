"""Audit a page with axe-core (https://github.com/dequelabs/axe-core), the script that accessibility tools share."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tests.browser.tab import Tab
from tests.support.graphics import lacking

SERIOUS = {"serious", "critical"}


def axe_script() -> str:
    """Return the script. Where it is not installed the test is skipped, or fails where CI is set."""
    found = find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        lacking("This test audits a page with axe-core, which is not installed: pip install 'fedora-qa[dev]'")
    return Path(found.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def violations(tab: Tab, script: str) -> dict[str, list[str]]:
    """Return the rules that a page breaks seriously, each with the elements that do, as they stand."""
    # Not through the page: its policy runs no script but its own.
    tab.call("Runtime.evaluate", expression=script)
    only = "{resultTypes: ['violations']}"
    found: list[dict[str, Any]] = tab.evaluate(f"axe.run({only}).then(result => result.violations)")
    return {
        one["id"]: [f"{node['html'][:160]} {node['failureSummary'][:200]}" for node in one["nodes"]]
        for one in found
        if one["impact"] in SERIOUS
    }
