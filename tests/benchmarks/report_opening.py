"""How large the report of half an hour with a thousand findings is, and how long it takes to draw and to open.

Run ``python -m tests.benchmarks.report_opening``. The record and its evidence are invented, with pictures of noise,
which nothing compresses: larger than real ones.
"""

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from fedora_reports.html import render_html
from tests.browser.devtools import Browser
from tests.browser.tab import Tab
from tests.reports.long_sequence import long_arrays, long_record
from tests.support.graphics import require_chromium

_REPEATS = 5
_TIMES = """
(() => {
  const [page] = performance.getEntriesByType("navigation");
  const paint = performance.getEntriesByName("first-contentful-paint")[0];
  return [paint ? paint.startTime : null, page.domContentLoadedEventEnd, page.loadEventEnd];
})()
"""


@dataclass(frozen=True, slots=True)
class Opening:
    """Seconds from the start of loading until the page is painted first, until scripts have run, until it is loaded."""

    painted_s: float
    ready_s: float
    loaded_s: float


def opening(browser: Browser, page: Path) -> Opening:
    """Open a page once, in a tab of its own."""
    with Tab(browser, page) as tab:
        tab.evaluate("new Promise(done => requestAnimationFrame(() => setTimeout(done, 50)))")
        painted, ready, loaded = (value / 1e3 if value else float("nan") for value in tab.evaluate(_TIMES))
        return Opening(painted, ready, loaded)


def main() -> None:
    """Print the figures as a table of markdown."""
    arrays = long_arrays()
    record = long_record(arrays)
    started = time.process_time()
    html = render_html(record, arrays)
    drawn_s = time.process_time() - started
    with tempfile.TemporaryDirectory() as folder, Browser(require_chromium()) as browser:
        page = Path(folder, "report.html")
        page.write_text(html, encoding="utf-8")
        runs = [opening(browser, page) for _ in range(_REPEATS)]
    rows = {
        "size, MB": len(html.encode()) / 1e6,
        "drawn, s of processor": drawn_s,
        "first painted, s": median(run.painted_s for run in runs),
        "scripts have run, s": median(run.ready_s for run in runs),
        "loaded, s": median(run.loaded_s for run in runs),
    }
    sys.stdout.write("| what | value |\n| --- | ---: |\n")
    for name, value in rows.items():
        sys.stdout.write(f"| {name} | {value:.2f} |\n")


if __name__ == "__main__":
    main()
