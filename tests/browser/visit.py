"""Open a page as a reader would, and say what came of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.browser.devtools import Browser, Message

# Everything folded is opened first: what is hidden in it must be in order too.
_UNFOLD = "for (const part of document.querySelectorAll('details')) part.open = true"

_MEASURE = """
(async () => {
  const pictures = [...document.images];
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
    drawings: [...document.querySelectorAll('figure svg')].map(box),
    tables: [...document.querySelectorAll('table')].map(box),
    captions: [...document.querySelectorAll('figure')].map(f => f.querySelector('figcaption')?.innerText ?? ''),
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


def visit(browser: Browser, page: Path, *, width: int, scheme: str) -> Visit:
    """Open a file in a new tab, so many px wide and in a ``light`` or ``dark`` scheme, unfold it and measure."""
    browser.events.clear()
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    tab = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(f"{domain}.enable", tab)
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.call("Emulation.setDeviceMetricsOverride", tab, **size)
    browser.call("Emulation.setEmulatedMedia", tab, features=[{"name": "prefers-color-scheme", "value": scheme}])
    browser.events.clear()
    browser.call("Page.navigate", tab, url=page.resolve().as_uri())
    browser.wait_for("Page.loadEventFired")
    _evaluate(browser, tab, _UNFOLD)
    seen = _evaluate(browser, tab, _MEASURE)
    browser.call("Target.closeTarget", targetId=target)
    return Visit(seen, _complaints(browser.events), _requests(browser.events))


def _evaluate(browser: Browser, tab: str, script: str) -> Any:
    done = browser.call("Runtime.evaluate", tab, expression=script, awaitPromise=True, returnByValue=True)
    if "exceptionDetails" in done:
        raise RuntimeError(done["exceptionDetails"]["exception"]["description"])
    return done["result"].get("value")


def _complaints(events: list[Message]) -> list[str]:
    """Return every error and warning of the console, of the browser's log, and every uncaught exception."""
    said = []
    for event in events:
        params = event.get("params", {})
        match event.get("method"):
            case "Runtime.consoleAPICalled" if params["type"] in {"error", "warning", "assert"}:
                said.append(str([argument.get("value") for argument in params["args"]]))
            case "Runtime.exceptionThrown":
                said.append(str(params["exceptionDetails"]["text"]))
            case "Log.entryAdded" if params["entry"]["level"] in {"error", "warning"}:
                said.append(str(params["entry"]["text"]))
    return said


def _requests(events: list[Message]) -> list[str]:
    """Return every address that was asked for, in order; what is inside the page (data:) is none."""
    asked = (e["params"]["request"]["url"] for e in events if e.get("method") == "Network.requestWillBeSent")
    return [url for url in asked if not url.startswith("data:")]
