"""Open a page as a reader would, and say what came of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.browser.devtools import Browser
from tests.browser.tab import Tab

# Everything folded is opened first: what is hidden in it must be in order too.
_UNFOLD = "for (const part of document.querySelectorAll('details')) part.open = true"

_MEASURE = """
(async () => {
  // With scripts one moment is shown at a time, and the rows of all of them are not; what needs scripts is not without.
  // A still picture gives way to one that can be turned.
  const shown = e => !e.closest('.js .instants, .js .still') && !e.closest('html:not(.js) .with-script');
  const pictures = [...document.images].filter(shown);
  await Promise.all(pictures.map(picture => picture.decode().catch(() => null)));
  await document.fonts.ready;
  const box = element => { const b = element.getBoundingClientRect(); return [b.width, b.height]; };
  const root = document.documentElement;
  const right = element => element.getBoundingClientRect().right;
  const scrolls = e => { for (; e; e = e.parentElement)
    if (/auto|scroll|hidden/.test(getComputedStyle(e).overflowX)) return true; return false; };
  return {
    text: document.body.innerText,
    pictures: pictures.map(p => ({name: p.alt, natural: p.naturalWidth, box: box(p)})),
    drawings: [...document.querySelectorAll('figure svg')].filter(shown).map(box),
    tables: [...document.querySelectorAll('table')].map(box),
    captions: [...document.querySelectorAll('figure')].filter(shown)
      .map(f => f.querySelector('figcaption')?.innerText ?? ''),
    questions: [...document.querySelectorAll('.check summary .asked')].map(e => e.getBoundingClientRect().width),
    heading: document.querySelector('h1')?.innerText ?? '',
    overflow: root.scrollWidth - root.clientWidth,
    sticking_out: [...document.body.querySelectorAll('*')]
      .filter(e => right(e) > root.clientWidth + 0.5 && !scrolls(e)).map(e => e.outerHTML.slice(0, 120)),
    background: getComputedStyle(document.body).backgroundColor,
    colour: getComputedStyle(document.body).color,
  };
})()
"""


@dataclass(frozen=True, slots=True)
class Visit:
    """What a page showed. ``seen`` holds what was measured in the page; see ``_MEASURE``."""

    seen: dict[str, Any]
    complaints: list[str]
    requests: list[str]


def visit(browser: Browser, page: Path, *, width: int, scheme: str, scripts: bool = True) -> Visit:
    """Open a file in a new tab, so many px wide and in a ``light`` or ``dark`` scheme, unfold it and measure."""
    with Tab(browser, page, width=width, scheme=scheme, scripts=scripts) as tab:
        tab.evaluate(_UNFOLD)
        seen = tab.evaluate(_MEASURE)
        return Visit(seen, tab.complaints, tab.requests)
