"""Small sequences in which tests plant kinds."""

from tests.benchmarks.foreign.scenes import Size
from tests.benchmarks.foreign_faults.kind import Kind
from tests.benchmarks.foreign_faults.sources import Source
from tests.benchmarks.foreign_faults.table import KINDS

BY_NAME = {kind.name: kind for kind in KINDS}
SMALL = Size(90, 68, 0.4)


def source_of(kind: Kind) -> Source:
    """Return the sequence in which the tests plant a kind."""
    return Source("park-noisy" if kind.scenes == ("park-noisy",) else "park-day", 0)
