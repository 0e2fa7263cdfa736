"""The planters of foreign faults: each alters what it says and nothing else, by an amount that is known.

Held-out kinds are planted here as well; what the checks say of them is not looked at.
"""

import ast
import filecmp
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.causes import CAUSES, INDEX_MAPS, TIMED, allowed
from tests.benchmarks.foreign_faults.eighth_round.kinds import EIGHTH_ROUND
from tests.benchmarks.foreign_faults.eleventh_round.kinds import ELEVENTH_ROUND
from tests.benchmarks.foreign_faults.fifth_round.kinds import FIFTH_ROUND
from tests.benchmarks.foreign_faults.fourth_round.kinds import FOURTH_ROUND
from tests.benchmarks.foreign_faults.kind import ALL_SCENES, LAST_ROUND, SHARES, Kind, Plan, Range
from tests.benchmarks.foreign_faults.ninth_round.kinds import NINTH_ROUND
from tests.benchmarks.foreign_faults.outcome import state_path
from tests.benchmarks.foreign_faults.second_round.kinds import SECOND_ROUND
from tests.benchmarks.foreign_faults.seventh_round.kinds import SEVENTH_ROUND
from tests.benchmarks.foreign_faults.sixth_round.kinds import SIXTH_ROUND
from tests.benchmarks.foreign_faults.small_sources import BY_NAME
from tests.benchmarks.foreign_faults.sources import SPAN_S, Source
from tests.benchmarks.foreign_faults.table import KINDS
from tests.benchmarks.foreign_faults.tenth_round.kinds import TENTH_ROUND
from tests.benchmarks.foreign_faults.third_round.kinds import THIRD_ROUND
from tests.benchmarks.foreign_faults.twelfth_round.kinds import TWELFTH_ROUND
from tests.support.contents import Contents

FOLDERS = [Path(__file__).parent, Path(__file__).parents[1] / "foreign"]
TESTS = ("test_", "conftest")


def test_there_are_enough_kinds() -> None:
    """At least 66 with names and files of their own, local ones and composites among them."""
    assert len(BY_NAME) == len(KINDS) >= 66
    paths = {state_path(Path(), kind, Source("park-day", 0)).name.lower() for kind in KINDS}
    assert len(paths) == len(KINDS)
    assert sum(kind.local for kind in KINDS) >= 20
    assert sum(kind.composite for kind in KINDS) >= 5
    assert sum(not kind.truth for kind in KINDS) >= 10


def test_the_last_round_is_held_out() -> None:
    """All of it and nothing else."""
    assert {kind.round for kind in KINDS} == set(range(1, LAST_ROUND + 1))
    assert [kind for kind in KINDS if kind.held_out] == list(TWELFTH_ROUND)


@pytest.mark.parametrize(
    "kinds",
    [
        *(SECOND_ROUND, THIRD_ROUND, FOURTH_ROUND, FIFTH_ROUND),
        *(SIXTH_ROUND, SEVENTH_ROUND, EIGHTH_ROUND, NINTH_ROUND, TENTH_ROUND, ELEVENTH_ROUND),
    ],
)
def test_a_later_round_has_enough_kinds_of_its_own(kinds: tuple[Kind, ...]) -> None:
    """Of every stream, with a name and without, local ones and composites."""
    assert len({kind.round for kind in kinds}) == 1
    assert sum(bool(kind.truth) and not kind.composite for kind in kinds) >= 0.75 * len(kinds)
    assert sum(kind.composite for kind in kinds) >= 3
    assert sum(kind.local for kind in kinds) >= 10
    assert sum(not kind.truth for kind in kinds) >= 6
    assert {truth.split(":")[0] for kind in kinds for truth in kind.truth} >= {*TIMED, *INDEX_MAPS, "metadata"}


def test_the_twelfth_round_has_a_kind_of_each_cause() -> None:
    """One of each but `unknown`, in a stream that was drawn, and six of two causes of different streams."""
    causes = [kind.truth[0].split(":")[1] for kind in TWELFTH_ROUND if not kind.composite]
    assert sorted(causes) == sorted(set(CAUSES) - {"unknown"})
    assert {kind.round for kind in TWELFTH_ROUND} == {12}
    assert sum(kind.local for kind in TWELFTH_ROUND) >= 15
    streams = [[truth.split(":")[0] for truth in kind.truth] for kind in TWELFTH_ROUND if kind.composite]
    assert len(streams) == 6
    assert all(first != second for first, second in streams)


@pytest.mark.parametrize("name", BY_NAME)
def test_truths_are_causes(name: str) -> None:
    """Stream and cause fit; a composite has two; scenes are those of the study."""
    kind = BY_NAME[name]
    pairs = [truth.split(":") for truth in kind.truth]
    assert all(allowed(cause, stream) for stream, cause in pairs)
    assert not any(cause == "unknown" for _, cause in pairs)
    assert len(set(kind.truth)) == len(kind.truth)
    assert not kind.composite or len(kind.truth) == 2
    assert kind.scenes
    assert set(kind.scenes) <= set(ALL_SCENES) == set(SPAN_S)
    assert kind.pipeline.endswith(".")
    assert len(kind.truth) < 2 or kind.composite or kind.debatable or "gravity" in kind.name


def test_no_planter_knows_other_faults() -> None:
    """Neither the generator's faults, nor those of the canary, nor the corpus are imported."""
    forbidden = ("fedora_generator.faults", "fedora_generator.corpus", "fedora_qa.faults", "fedora_qa.diagnosis")
    imported: set[str] = set()
    for path in (path for folder in FOLDERS for path in folder.rglob("*.py") if not path.name.startswith(TESTS)):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported |= {f"{node.module}.{alias.name}" for alias in node.names}
    assert len(imported) > 50
    assert not [name for name in imported if name.startswith(forbidden)]
    inside = {name for name in imported if name.startswith("tests.")}
    known = ("tests.benchmarks.foreign.", "tests.benchmarks.foreign_faults", "tests.benchmarks.processes.in_processes")
    assert all(name.startswith(known) for name in inside)


@pytest.mark.parametrize("name", BY_NAME)
def test_sizes_lie_in_their_range_and_differ(name: str) -> None:
    """Between sequences; so do places. The same sequence has the same."""
    kind = BY_NAME[name]
    plans = [kind.plan(scene, seed, Path()) for scene in SPAN_S for seed in range(4)]
    again = kind.plan("park-day", 0, Path())
    assert (again.size, again.begin, again.end) == (plans[0].size, plans[0].begin, plans[0].end)
    assert again.random.random() == plans[0].random.random()
    if kind.size is None:
        assert {plan.size for plan in plans} == {0.0}
    else:
        assert all(kind.size.holds(plan.size) for plan in plans)
        assert len({plan.size for plan in plans}) >= (3 if kind.size.whole else len(plans))
        assert len({plan.size > 0 for plan in plans}) == (2 if kind.size.signed else 1)
    if kind.local:
        assert all(0 < plan.begin < plan.end < 1 for plan in plans)
        assert all(SHARES[0] <= plan.end - plan.begin + 1e-12 <= SHARES[1] + 1e-9 for plan in plans)
        assert len({plan.begin for plan in plans}) == len(plans)
    else:
        assert all((plan.begin, plan.end) == (0.0, 1.0) for plan in plans)


@given(
    low=st.floats(1e-3, 1e3),
    factor=st.floats(1.1, 1e3),
    signed=st.booleans(),
    seed=st.integers(0, 2**32),
)
def test_any_size_lies_in_its_range(low: float, factor: float, signed: bool, seed: int) -> None:
    """Of any range; half of many lie below the geometric mean, where sizes are log-uniform."""
    sizes = Range(low, low * factor, "", signed)
    random = np.random.default_rng(seed)
    drawn = np.array([sizes.draw(random) for _ in range(400)])
    magnitudes = np.abs(drawn) * (1 + 1e-12)
    assert np.all((magnitudes >= low) & (np.abs(drawn) * (1 - 1e-12) <= low * factor))
    # 400 draws: a standard deviation of 10.
    assert abs(np.sum(magnitudes < low * factor**0.5) - 200) < 60
    assert signed or np.all(drawn > 0)


def test_sequences_begin_apart() -> None:
    """Not where those of the study of correct files begin, and a donor begins elsewhere."""
    for scene, span_s in SPAN_S.items():
        starts_s = [Source(scene, seed).start_s for seed in range(6)]
        assert np.diff(np.sort(starts_s)).min() > 0.05 * span_s
        assert all(0 <= start_s < span_s for start_s in starts_s)
        assert Source(scene, 3).donor.start_s == starts_s[4]


def lies_under(path: str, roots: tuple[str, ...]) -> bool:
    return any(path == root or path.startswith((f"{root}/", f"{root}@")) for root in roots)


@pytest.mark.parametrize("name", BY_NAME)
def test_a_planter_alters_what_it_says_and_nothing_else(
    name: str,
    pair_of: Callable[[str], tuple[Contents, Contents, Plan]],
    plant_in: Callable[[str, Path], Plan],
    planted: Path,
) -> None:
    """All other values, types and attributes stay, to the bit; nothing is added but a lens; what it says differs.

    The type of what it alters is another one, or a dataset goes, only where this is the fault. From the third round
    on a kind is planted the same again: two copies of the same sequence have the same bytes.
    """
    kind = BY_NAME[name]
    old, new, _ = pair_of(name)
    if kind.round >= 3:
        again = planted.with_name("again.h5")
        plant_in(name, again)
        assert filecmp.cmp(planted, again, shallow=False)
    absent = set(old) - set(new)
    added = set(new) - set(old)
    assert all("@distortion" in path for path in added)
    assert bool(added) == (":rectification_misdeclared" in "".join(kind.truth))
    assert all(lies_under(path, kind.alters) for path in added)
    assert bool(absent) == (":missing_stream" in "".join(kind.truth))
    assert all(lies_under(path, kind.alters) for path in absent)
    differing = added | {path for path in old if path in absent or not are_equal(new[path], old[path])}
    assert all(lies_under(path, kind.alters) for path in differing)
    for root in kind.alters:
        inside = [path for path in {*old, *new} if lies_under(path, (root,))]
        assert inside, root
        # Maps follow from the stamps and change only where those of events or of their frames do.
        if not root.endswith("_to_event"):
            assert differing & set(inside), root
    assert differing
    retyped = [path for path in set(new) - added if "@" not in path and new[path].dtype != old[path].dtype]
    assert bool(retyped) == (":wrong_dtype" in "".join(kind.truth))
    assert all(lies_under(path, kind.alters) for path in retyped)


def are_equal(new: Any, old: Any) -> bool:
    """Whether values and types are the same, to the bit but for what is not a number."""
    if new is old:
        return True
    return np.asarray(new).dtype == np.asarray(old).dtype and np.array_equal(new, old, equal_nan=is_float(old))


def is_float(values: Any) -> bool:
    return np.issubdtype(np.asarray(values).dtype, np.floating)
