"""Clean sequences, and kinds that are planted in them."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.outcome import plant
from tests.benchmarks.foreign_faults.small_sources import BY_NAME, SMALL, source_of
from tests.benchmarks.foreign_faults.sources import Source
from tests.support.contents import Contents, OriginalFile
from tests.support.shared_files import SharedFiles


@pytest.fixture(scope="module")
def clean_of(shared_files: SharedFiles) -> Callable[[Source], Path]:
    """Clean sequences of any scene and seed."""

    @cache
    def clean(source: Source) -> Path:
        name = f"foreign-faults-{source.scene}-{source.seed}.h5"
        return shared_files.file(name, lambda path: source.write(SMALL, path))

    return clean


@pytest.fixture(scope="module")
def plant_in(clean_of: Callable[[Source], Path]) -> Callable[[str, Path], Plan]:
    """Plants a kind in a copy of its clean sequence, and returns what was planted."""

    def plant_kind(name: str, target: Path) -> Plan:
        kind = BY_NAME[name]
        source, donor = source_of(kind), clean_of(Source("park-day", 1))
        plant(kind, kind.plan(source.scene, source.seed, donor), clean_of(source), target)
        return kind.plan(source.scene, source.seed, donor)

    return plant_kind


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file that ``pair_of`` writes, and overwrites when it is called again."""
    return tmp_path_factory.mktemp("foreign-faults") / "a.h5"


@pytest.fixture(scope="module")
def pair_of(
    clean_of: Callable[[Source], Path], plant_in: Callable[[str, Path], Plan], planted: Path
) -> Callable[[str], tuple[Contents, Contents, Plan]]:
    """Plants a kind: contents before and after, and what was planted."""
    original_of = cache(OriginalFile)

    def pair(name: str) -> tuple[Contents, Contents, Plan]:
        plan = plant_in(name, planted)
        kind = BY_NAME[name]
        original = original_of(clean_of(source_of(kind)))
        is_damaged = ":corrupt_chunk" in "".join(kind.truth)
        return original.contents, original.contents_of_copy(planted, is_damaged=is_damaged), plan

    return pair
