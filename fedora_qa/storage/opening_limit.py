"""How long the opening of a file may take: HDF5 follows some damaged structures for ever (docs/hostile-files.md)."""

import math
import os
from typing import Final

from fedora_qa.errors import MisuseError

OPENING_VARIABLE: Final = "FEDORA_QA_OPENING_S"
"""Environment variable: seconds within which a file must open."""


def opening_limit_s(usual_s: float) -> float:
    """Return the seconds that the environment sets, or the usual ones.

    Raises
    ------
    MisuseError
        The environment sets a limit that is no number above 0.
    """
    given = os.environ.get(OPENING_VARIABLE)
    try:
        limit_s = usual_s if given is None else float(given)
    except ValueError:
        limit_s = 0.0
    if not 0.0 < limit_s < math.inf:
        raise MisuseError(f"Expected seconds in {OPENING_VARIABLE}, such as 60, got {given!r}")
    return limit_s
