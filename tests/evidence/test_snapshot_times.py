"""Moments are evenly spread over what is looked at, and their pictures fit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.snapshot import fitting_width_px, snapshot_bytes, snapshot_times_ns
from fedora_qa.layout.binding import Binding
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.facts import Facts
from tests.evidence.memory import memory
from tests.support.facts import MS, clock, exact_facts


def test_moments_lie_where_every_rate_begins() -> None:
    """Six moments of a second of 10 Hz flow are starts of its fields, each in the window that owns it."""
    file = memory()
    instants = snapshot_times_ns(file.spans, file.facts, 6)
    times_ms = [time_ns // MS for window in instants.values() for time_ns in window]
    assert times_ms == [0, 200, 400, 500, 700, 900]
    assert all(
        file.spans[number].start_ns <= t < file.spans[number].stop_ns for number, ts in instants.items() for t in ts
    )


def test_moments_are_of_the_windows_looked_at() -> None:
    """Sampled windows alone hold moments, all of them where there are fewer images than moments."""
    file = memory()
    assert set(snapshot_times_ns(file.spans[2:4], file.facts, 3)) == {2, 3}
    few = snapshot_times_ns(file.spans[-1:], file.facts, 6)
    assert few == {5: (1000 * MS,)}


def test_files_without_images_show_the_middle_of_windows() -> None:
    """Events and motion alone have moments as well."""
    file = memory()
    motion = {name: file.facts.clocks[name] for name in ("imu", "pose")}
    instants = snapshot_times_ns(file.spans, replace(file.facts, clocks=motion), 2)
    assert instants == {1: (300 * MS,), 4: (900 * MS,)}
    assert snapshot_times_ns((), file.facts, 6) == {}


def test_dead_clocks_place_no_moment() -> None:
    """Stamps that stand still are passed over for those of another stream."""
    file = memory()
    dead = {name: clock(np.zeros(len(one.times_ns), np.int64)) for name, one in file.facts.clocks.items()}
    facts = replace(file.facts, clocks={**dead, "depth": file.facts.clocks["depth"]})
    times = [t for window in snapshot_times_ns(file.spans, facts, 3).values() for t in window]
    assert times == [160 * MS, 500 * MS, 840 * MS]


def with_shapes(height: int, width: int) -> Facts:
    """Facts of a file whose images have this size."""
    facts = exact_facts()
    shapes = {
        "path/rgb": (9, height, width, 3),
        "path/depth": (9, height, width),
        "path/flow/50hz": (9, height, width, 2),
    }
    bindings = {key: Binding(key, key, 9, shape, np.dtype("f4")) for key, shape in shapes.items()}
    return replace(facts, layout=Layout("fedora", bindings, frozenset(shapes), {}))


@given(st.integers(1, 4000), st.integers(1, 4000), st.integers(1, 12))
def test_pictures_fit_into_the_size(height: int, width: int, snapshots: int) -> None:
    """Whatever the images, so many glimpses stay within the size, unless even the least pictures do not."""
    facts, options = with_shapes(height, width), EvidenceOptions(size_bytes=1 << 20)
    chosen = fitting_width_px(facts, options, snapshots)
    assert chosen <= 360
    assert snapshots * snapshot_bytes(facts, chosen) <= options.size_bytes or chosen == 16


@pytest.mark.parametrize(("width", "height", "expected"), [(270, 200, 270), (1440, 1080, 288)])
def test_usual_images(width: int, height: int, expected: int) -> None:
    """With the default size small images stay whole and the paper's become 288 px wide."""
    chosen = fitting_width_px(with_shapes(height, width), EvidenceOptions(), EvidenceOptions().snapshots)
    assert width // -(-width // chosen) == expected
