"""What each effort costs, and what it finds: ``make study-trade`` writes docs/trade.md.

Each fault is planted at one, two and four times what ``full`` states as its limit in that file, and sought at every
effort by the check whose limit it is. Costs are of all checks together. What was measured is kept in out/trade, so that
an interrupted study goes on where it was; ``--fresh`` forgets it.
"""

import json
import shutil
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import click
import h5py
import hdf5plugin  # noqa: F401  (reading needs its filters)

from fedora_generator.faults import plant_fault
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.engine.effort import Effort
from fedora_qa.engine.plan import make_plan
from fedora_qa.engine.prepare import prepare
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.sequence.sequence import open_sequence
from tests.benchmarks.trade.page import Cost, Found, chart, page
from tests.benchmarks.trade.traded import (
    BASES,
    DURATION_S,
    EFFORTS,
    LARGER,
    SIZE,
    STEP_S,
    TIMES_LIMIT,
    TRADED,
    Size,
    Traded,
)

ROOT: Final = Path(__file__).parents[3]
TARGET: Final = ROOT / "docs" / "trade.md"
KEPT: Final = ROOT / "out" / "trade"


@click.command()
@click.option("--jobs", default=2, show_default=True, help="Processes that seek faults; costs are measured by one.")
@click.option("--fresh", is_flag=True, help="Forget what was measured before.")
def main(jobs: int, fresh: bool) -> None:
    """Generate, plant, check, and write docs/trade.md."""
    if fresh:
        shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        scenes = dict.fromkeys(traded.scene for traded in TRADED)
        list(pool.map(_base, *zip(*((scene, number) for scene in scenes for number in range(BASES)), strict=True)))
        trials = [(traded, number) for number in range(BASES) for traded in TRADED]
        found = [one for each in pool.map(_trial, *zip(*trials, strict=True)) for one in each]
    costs = [_cost(scene, effort) for scene in scenes for effort in EFFORTS]
    larger = [_cost(TRADED[0].scene, effort, LARGER) for effort in EFFORTS]
    text = "".join(page(costs, larger, found))
    TARGET.write_text(text, encoding="utf-8")
    TARGET.with_suffix(".svg").write_text(chart(costs, found), encoding="utf-8")
    click.echo(text)


def _base(scene: str, number: int, size: Size = SIZE) -> Path:
    """Return a clean sequence, generated if it is not there."""
    target = KEPT / f"{scene}-{number}{'' if size == SIZE else f'-{size[0]}x{size[1]}'}.h5"
    if not target.exists():
        flown = replace(load_scene(scene).with_size(*size), seed=number).starting_at(STEP_S * number)
        generate_sequence(flown, target, Request(duration_s=DURATION_S, quality="draft"))
    return target


def _kept(name: str, measure: Callable[[], Any]) -> Any:
    """Return what was measured before under a name, or measure it and keep it."""
    target = KEPT / f"{name}.json"
    if not target.exists():
        part = target.with_suffix(".part")
        part.write_text(json.dumps(measure()), encoding="utf-8")
        part.replace(target)
    return json.loads(target.read_text(encoding="utf-8"))


def _trial(traded: Traded, number: int) -> list[Found]:
    """Plant a fault in one sequence in all sizes, and seek each at every effort."""
    base = _base(traded.scene, number)
    limit = _kept(f"{traded.check}.{traded.measurement.strip()}-{base.stem}", lambda: _limit(traded, base))
    if limit is None:
        return []
    return [_sized_trial(traded, number, base, times, times * limit) for times in TIMES_LIMIT]


def _sized_trial(traded: Traded, number: int, base: Path, times: float, size: float) -> Found:
    seen = _kept(f"{traded.stream}-{traded.cause}-{times:g}-{base.stem}", lambda: _seek(traded, base, size))
    return Found(traded.name, traded.scene, number, times, size, traded.unit, seen)


def _limit(traded: Traded, base: Path) -> float | None:
    """Return the fault that ``full`` says it would just see in a file; None where it could not say."""
    (result,) = check_file(base, CheckOptions(evidence=None, select=(traded.check,))).record.results
    stated = (one.least_detectable for one in result.measurements if one.name.endswith(traded.measurement))
    return min((limit for limit in stated if limit is not None), default=None)


def _seek(traded: Traded, base: Path, size: float) -> dict[str, bool]:
    """Return at which efforts the fault is found."""
    with TemporaryDirectory(dir=KEPT) as folder:
        faulty = Path(folder) / "faulty.h5"
        plant_fault(base, faulty, traded.cause, stream=traded.stream, magnitude=size, unit=traded.unit, seed=1)
        return {effort: _fails(faulty, effort, traded.check) for effort in EFFORTS}


def _fails(path: Path, effort: Effort, check: str) -> bool:
    record = check_file(path, CheckOptions(evidence=None, effort=effort, select=(check,))).record
    return record.verdict == "findings"


def _cost(scene: str, effort: Effort, size: Size = SIZE) -> Cost:
    """Measure a check of everything in one clean sequence, beside plain reading of all of it, both by one thread."""
    base = _base(scene, 0, size)
    values = _kept(f"cost-{effort}-{base.stem}", lambda: _measured_cost(base, effort))
    return Cost(scene, effort, **values)


def _measured_cost(base: Path, effort: Effort) -> dict[str, float | str]:
    read = min(_read_s(base) for _ in range(3))
    check_file(base, CheckOptions(evidence=None, effort="quick"))  # compiled, and in memory
    began = time.process_time()
    run = check_file(base, CheckOptions(evidence=None, effort=effort))
    spent = time.process_time() - began
    return {
        "reading_s": read,
        "checking_s": spent,
        "decoded_bytes": float(run.decoded_bytes),
        "window_share": _window_share(base, effort),
        "verdict": run.record.verdict,
        "blind": float(sum(result.outcome == "not_observable" for result in run.record.results)),
    }


def _window_share(base: Path, effort: Effort) -> float:
    with open_sequence(base) as sequence:
        ready = prepare(sequence, CheckOptions().memory_bytes)
    plan = make_plan(effort, len(ready.spans), ready.scanned.cell_ns)
    return len(plan.chosen) / plan.of


def _read_s(path: Path) -> float:
    began = time.process_time()
    with h5py.File(path) as file:
        names: list[str] = []
        file.visit(names.append)
        for item in map(file.get, names):
            if isinstance(item, h5py.Dataset):
                item[()]
    return time.process_time() - began


if __name__ == "__main__":
    main()
