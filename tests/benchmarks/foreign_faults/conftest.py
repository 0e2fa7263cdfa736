"""Clean sequences, and kinds that are planted in them."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.outcome import plant
from tests.benchmarks.foreign_faults.small_sources import BY_NAME, SMALL, source_of
from tests.benchmarks.foreign_faults.sources import Source
from tests.support.contents import Contents, contents_of
from tests.support.shared_files import SharedFiles


@pytest.fixture(scope="module")
def clean_of(shared_files: SharedFiles) -> Callable[[Source], Path]:
    """Clean sequences of any scene and seed."""

    def clean(source: Source) -> Path:
        name = f"foreign-faults-{source.scene}-{source.seed}.h5"
        return shared_files.file(name, lambda path: source.write(SMALL, path))

    return clean


@pytest.fixture(scope="module")
def pair_of(
    clean_of: Callable[[Source], Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Contents, Contents, Plan]]:
    """Plants a kind: contents before and after, and what was planted."""
    target = tmp_path_factory.mktemp("foreign-faults") / "a.h5"
    read_clean = cache(contents_of)

    def planted(name: str) -> tuple[Contents, Contents, Plan]:
        kind = BY_NAME[name]
        source = source_of(kind)
        clean, donor = clean_of(source), clean_of(Source("park-day", 1))
        plant(kind, kind.plan(source.scene, source.seed, donor), clean, target)
        after = contents_of(target, is_damaged=":corrupt_chunk" in "".join(kind.truth))
        return read_clean(clean), after, kind.plan(source.scene, source.seed, donor)

    return planted
