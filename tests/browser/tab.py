"""A tab of a browser: open a page as a reader would, click, type, and look at what it shows."""

import base64
import json
from pathlib import Path
from typing import Any, Self

from tests.browser.devtools import Browser, Message


class Tab:
    """One page, so many px wide, in a ``light`` or ``dark`` scheme, with or without scripts; ``with`` closes it."""

    def __init__(
        self, browser: Browser, page: Path, *, width: int = 1200, scheme: str = "light", scripts: bool = True
    ) -> None:
        self._browser = browser
        self._target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=self._target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.show_as(scheme)
        self.call("Emulation.setScriptExecutionDisabled", value=not scripts)
        browser.events.clear()
        self.call("Page.navigate", url=page.resolve().as_uri())
        browser.wait_for("Page.loadEventFired")

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the tab."""
        self._browser.call("Target.closeTarget", targetId=self._target)

    def call(self, method: str, **params: Any) -> Message:
        """Send a command to this tab."""
        return self._browser.call(method, self._session, **params)

    def show_as(self, scheme: str, media: str = "") -> None:
        """Prefer a colour scheme, and show as on ``screen`` or in ``print``."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", media=media, features=features)

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression in the page; raises what it raises."""
        done = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in done:
            raise RuntimeError(done["exceptionDetails"]["exception"]["description"])
        return done["result"].get("value")

    def place_of(self, selector: str, across: float = 0.5, down: float = 0.5) -> tuple[float, float]:
        """Scroll to an element and return a place in it, by shares of its box, in px of the window.

        It is looked for again until two frames of the browser leave it where it is: what was just shown may move it.
        """
        x, y = self.evaluate(
            f"(async () => {{ const e = document.querySelector({json.dumps(selector)}); "
            "const frame = () => new Promise(requestAnimationFrame); let last = ''; "
            "for (;;) { e.scrollIntoView({block: 'center', behavior: 'instant'}); await frame(); await frame(); "
            "const b = e.getBoundingClientRect(), here = [b.x, b.y, b.width, b.height].join(); "
            f"if (here === last) return [b.x + {across} * b.width, b.y + {down} * b.height]; last = here; }} }})()"
        )
        return x, y

    def click(self, selector: str, across: float = 0.5, down: float = 0.5) -> None:
        """Click on a place in an element with the mouse, wherever that leads."""
        x, y = self.place_of(selector, across, down)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def drag(self, selector: str, by: tuple[float, float]) -> None:
        """Press the mouse in the middle of an element, move it, and let go."""
        x, y = self.place_of(selector)
        held = {"button": "left", "buttons": 1}
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, clickCount=1, **held)
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + by[0], y=y + by[1], **held)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + by[0], y=y + by[1], button="left")

    def swipe(self, selector: str, by: tuple[float, float]) -> None:
        """Put a finger on the middle of an element, move it, and lift it."""
        x, y = self.place_of(selector)
        self.call("Emulation.setTouchEmulationEnabled", enabled=True)
        for kind, share in (("touchStart", 0.0), ("touchMove", 0.5), ("touchMove", 1.0)):
            point = {"x": x + share * by[0], "y": y + share * by[1]}
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[point])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def pinch(self, selector: str, first_px: float, last_px: float) -> None:
        """Put two fingers at a distance from the middle of an element, move them to another distance, and lift both."""
        x, y = self.place_of(selector)
        self.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
        for kind, side in (("touchStart", first_px), ("touchMove", (first_px + last_px) / 2), ("touchMove", last_px)):
            points = [{"x": x - side, "y": y, "id": 0}, {"x": x + side, "y": y, "id": 1}]
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def point_at(self, selector: str, across: float, down: float) -> None:
        """Move the mouse to a place in an element."""
        x, y = self.place_of(selector, across, down)
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def press(self, key: str, code: int) -> None:
        """Press a key; ``code`` is its Windows virtual key code."""
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def type_into(self, selector: str, text: str) -> None:
        """Focus a field and type, as the keyboard would."""
        self.evaluate(f"document.querySelector({json.dumps(selector)}).focus()")
        self.call("Input.insertText", text=text)

    def choose(self, selector: str, value: str) -> None:
        """Choose an option of a list."""
        self.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.value = {json.dumps(value)}; "
            "e.dispatchEvent(new Event('input', {bubbles: true})); })()"
        )

    def pdf(self) -> bytes:
        """Return the page as it would be printed on A4."""
        return base64.b64decode(self.call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"])

    @property
    def complaints(self) -> list[str]:
        """Every error and warning of the console, of the browser's log, and every uncaught exception."""
        self.evaluate("0")  # what was said before has arrived
        said = []
        for event in self._browser.events:
            params = event.get("params", {})
            match event.get("method"):
                case "Runtime.consoleAPICalled" if params["type"] in {"error", "warning", "assert"}:
                    said.append(str([argument.get("value") for argument in params["args"]]))
                case "Runtime.exceptionThrown":
                    said.append(str(params["exceptionDetails"]["text"]))
                case "Log.entryAdded" if params["entry"]["level"] in {"error", "warning"}:
                    said.append(str(params["entry"]["text"]))
        return said

    @property
    def requests(self) -> list[str]:
        """Every address that was asked for, in order; what is inside the page (data:) is none."""
        sent = (event for event in self._browser.events if event.get("method") == "Network.requestWillBeSent")
        asked = (event["params"]["request"]["url"] for event in sent)
        return [url for url in asked if not url.startswith("data:")]
