"""A headless Chromium, driven over a pipe by the DevTools protocol (https://chromedevtools.github.io/devtools-protocol)."""

import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any, Self

Message = dict[str, Any]

_ANSWER_S = 60.0
_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage"),
)


class Browser:
    """One browser process with a profile of its own; ``with`` ends it.

    Chromium reads commands from file descriptor 3 and writes answers and events to 4, each ended by a zero byte.
    """

    def __init__(self, chromium: Path) -> None:
        self._profile = tempfile.mkdtemp(prefix="fedora-chromium-")
        commands, self._to_browser = os.pipe()
        self._from_browser, answers = os.pipe()
        flags = (*_FLAGS, "--remote-debugging-pipe", f"--user-data-dir={self._profile}")
        # Not `3<&10`: a POSIX shell need not know descriptors of two digits.
        placed = f'exec "$@" 3</dev/fd/{commands} 4>/dev/fd/{answers}'
        self._process = subprocess.Popen(
            ["sh", "-c", placed, "sh", str(chromium), *flags, "about:blank"],
            pass_fds=(commands, answers),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(commands)
        os.close(answers)
        self._unread = b""
        self._last_id = 0
        self.events: list[Message] = []

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ask the browser to go, wait until it has, and remove its profile."""
        try:
            if self._process.poll() is None:
                self.call("Browser.close")
            self._process.wait(timeout=_ANSWER_S)
        except (OSError, TimeoutError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        os.close(self._to_browser)
        os.close(self._from_browser)
        shutil.rmtree(self._profile, ignore_errors=True)

    def call(self, method: str, session: str = "", **params: Any) -> Message:
        """Send a command and return its result; events that arrive meanwhile are kept in ``events``."""
        self._last_id += 1
        message = {"id": self._last_id, "method": method, "params": params}
        os.write(self._to_browser, json.dumps(message | ({"sessionId": session} if session else {})).encode() + b"\0")
        while True:
            answer = self._next(time.monotonic() + _ANSWER_S)
            if answer.get("id") != self._last_id:
                self.events.append(answer)
            elif "error" in answer:
                raise RuntimeError(f"{method}: {answer['error']['message']}")
            else:
                result: Message = answer["result"]
                return result

    def wait_for(self, method: str) -> None:
        """Read events until one of this name has come."""
        deadline = time.monotonic() + _ANSWER_S
        while all(event.get("method") != method for event in self.events):
            self.events.append(self._next(deadline))

    def _next(self, deadline: float) -> Message:
        while b"\0" not in self._unread:
            ready, _, _ = select.select([self._from_browser], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise TimeoutError(f"Chromium did not answer within {_ANSWER_S:.0f} s")
            piece = os.read(self._from_browser, 1 << 16)
            if not piece:
                raise ConnectionError(f"Chromium ended with {self._process.wait()}")
            self._unread += piece
        text, self._unread = self._unread.split(b"\0", 1)
        message: Message = json.loads(text)
        return message
