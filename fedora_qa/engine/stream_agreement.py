"""Evidence of which streams agree: for each pair of streams, how many of the checks that compare them passed."""

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Check
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.layout.canonical import FRAMES_OF_MAP
from fedora_qa.record.evidence import AGREEMENT, named
from fedora_qa.record.types import Outcome


def keep_agreement(checks: Iterable[Check[Any]], outcomes: Mapping[str, Outcome]) -> TitledArrays:
    """Return numbers of passed and failed checks by pair of streams: the odd stream fails with all others.

    Parameters
    ----------
    checks
        Of the file. A check of three streams counts for each pair of them; all rates of flow are one stream.
    outcomes
        By check; those that are neither passed nor failed do not count.
    """
    counts: Counter[tuple[str, str, Outcome]] = Counter()
    for check in checks:
        # Index maps are no streams: they hold rows of events.
        streams = sorted({stream_family(stream) for stream in check.needs} - set(FRAMES_OF_MAP))
        for first, second in combinations(streams, 2):
            counts[first, second, outcomes.get(check.name, "crashed")] += 1
    pairs = sorted({(first, second) for first, second, outcome in counts if outcome in ("passed", "failed")})
    entries = {
        named(AGREEMENT, first, second): (
            np.array([counts[first, second, "passed"], counts[first, second, "failed"]]),
            f"Checks that compare {first} with {second}: passed, failed",
        )
        for first, second in pairs
    }
    return TitledArrays.titled(entries)
