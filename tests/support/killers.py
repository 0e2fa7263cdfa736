"""Checks that do harm, to be done in processes of their own."""

import os
import signal
from pathlib import Path

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window


class Counts(Check[list[int]]):
    """How many windows are there?"""

    name = "test.counts"

    def start(self, facts: Facts) -> list[int]:
        """Return no window."""
        return []

    def update(self, state: list[int], window: Window) -> None:
        """Note the window."""
        state.append(window.span.index)

    def merge(self, state: list[int], later: list[int]) -> list[int]:
        """Concatenate."""
        return state + later

    def conclude(self, state: list[int], facts: Facts) -> Observation:
        """Say how many were seen."""
        return Observation(Coverage(len(state), len(state), "windows"), inferred={"seen": str(state)})


class Kills(Counts):
    """What if the process that asks is killed?"""

    name = "test.kills"

    def __init__(self, once: Path | None = None) -> None:
        self._once = once

    def update(self, state: list[int], window: Window) -> None:
        """Kill the process, for the first time only where a file is given that can tell."""
        if self._once is None or not self._once.exists():
            if self._once:
                self._once.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        super().update(state, window)


class CrashesLate(Counts):
    """What if a check fails on a later window?"""

    name = "test.crashes"

    def update(self, state: list[int], window: Window) -> None:
        """Fail from the fourth window on."""
        if window.span.index >= 3:
            raise ZeroDivisionError(f"window {window.span.index}")
