"""Subjects of imaginary files: their depths are lognormal about a centre for each block of time."""

from collections.abc import Sequence

import numpy as np

from fedora_qa.comparison.subjects import FileInput, SampledCounts, SubjectInput
from fedora_qa.evidence.value_counts import count_values, octave_counts
from fedora_qa.record.types import FileRecord

STATISTICS = {
    "sequence": {"duration_s": 12.0, "event_rate_mean_per_s": 1.5e6},
    "motion": {"distance_m": 30.0, "distance_standard_error_m": 0.01},
    "flow/10hz": {"mean_px": 2.0, "variance_px2": 1.0, "pixels": 100},
    "depth": {"mean_m": 8.0, "disparity_mean_per_m": 0.2, "valid_share": 1.0},
}


def sampled(centres: Sequence[float], seed: int) -> SampledCounts:
    """The depths of one file, 300 a block."""
    random = np.random.default_rng(seed)
    values = np.exp(np.array(centres)[:, None] + 0.3 * random.standard_normal((len(centres), 300)))
    counts = np.stack([octave_counts(count_values(row)) for row in values])
    return SampledCounts(200_000_000, np.arange(len(centres)), {"depth_m": counts})


def given_file(path: str, centres: Sequence[float], seed: int = 0, record: FileRecord | None = None) -> FileInput:
    """A file of so many blocks."""
    return FileInput(path, STATISTICS, sampled(centres, seed), record)


def given(name: str, *files: FileInput) -> SubjectInput:
    """What one argument named."""
    return SubjectInput(name, files)
