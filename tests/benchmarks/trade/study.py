"""What each effort costs, and what it finds: ``make study-trade`` writes docs/trade.md.

Each fault is planted at one, two and four times what ``full`` states as its limit in that file, and sought at every
effort and budget by the check whose limit it is. Costs are of all checks together. Which windows a budget reaches is
measured with a clean file and all checks; what is found follows from them and nothing else. What was measured is kept
in out/trade, so that an interrupted study goes on where it was; ``--fresh`` forgets it, but for the sequences.
"""

import json
import re
import time
from collections.abc import Callable, Sequence
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
from fedora_qa.catalogue import select_checks
from fedora_qa.cli.exit_codes import CLEAN
from fedora_qa.engine.budget import visiting_order
from fedora_qa.engine.options import CheckOptions, Effort, FileRun
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import prepare, survey_of
from fedora_qa.engine.tasks import check_file, measure_and_assemble
from fedora_qa.sequence.sequence import open_sequence
from tests.benchmarks.full_size.measured_run import fedora_qa, run_measured
from tests.benchmarks.trade.chart import chart
from tests.benchmarks.trade.measured import Cost, Found, Reach
from tests.benchmarks.trade.page import page
from tests.benchmarks.trade.traded import (
    BASES,
    BUDGETS,
    DURATION_S,
    EFFORTS,
    LARGER,
    SAMPLED,
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
    KEPT.mkdir(parents=True, exist_ok=True)
    for kept in KEPT.glob("*.json") if fresh else ():
        kept.unlink()
    scenes = tuple(dict.fromkeys(traded.scene for traded in TRADED))
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        list(pool.map(_base, *zip(*((scene, number) for scene in scenes for number in range(BASES)), strict=True)))
    costs = [_cost(scene, effort) for scene in scenes for effort in EFFORTS]
    larger = [_cost(TRADED[0].scene, effort, LARGER) for effort in EFFORTS]
    reached = [_reach(scene, budget) for scene in scenes for budget in BUDGETS]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        trials = [
            (traded, number, [reach for reach in reached if reach.scene == traded.scene])
            for number in range(BASES)
            for traded in TRADED
        ]
        found = [one for each in pool.map(_trial, *zip(*trials, strict=True)) for one in each]
    text = "".join(page(costs, larger, reached, found))
    TARGET.write_text(text, encoding="utf-8")
    TARGET.with_suffix(".svg").write_text(chart(costs, reached, found), encoding="utf-8")
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


def _trial(traded: Traded, number: int, reached: Sequence[Reach]) -> list[Found]:
    """Plant a fault in one sequence in all sizes, and seek each at every effort and budget."""
    base = _base(traded.scene, number)
    limit = _kept(f"{traded.check}.{traded.measurement.strip()}-{base.stem}", lambda: _limit(traded, base))
    if limit is None:
        return []
    return [_sized_trial(traded, number, base, times, times * limit, reached) for times in TIMES_LIMIT]


def _sized_trial(traded: Traded, number: int, base: Path, times: float, size: float, reached: Sequence[Reach]) -> Found:
    seen = _kept(f"{traded.stream}-{traded.cause}-{times:g}-{base.stem}", lambda: _seek(traded, base, size, reached))
    return Found(traded.name, traded.scene, number, times, size, traded.unit, seen)


def _limit(traded: Traded, base: Path) -> float | None:
    """Return the fault that ``full`` says it would just see in a file; None where it could not say."""
    (result,) = check_file(base, CheckOptions(evidence=None, select=(traded.check,))).record.results
    stated = (one.least_detectable for one in result.measurements if one.name.endswith(traded.measurement))
    return min((limit for limit in stated if limit is not None), default=None)


def _seek(traded: Traded, base: Path, size: float, reached: Sequence[Reach]) -> dict[str, bool]:
    """Return at which efforts and budgets the fault is found."""
    with TemporaryDirectory(dir=KEPT) as folder:
        faulty = Path(folder) / "faulty.h5"
        plant_fault(base, faulty, traded.cause, stream=traded.stream, magnitude=size, unit=traded.unit, seed=1)
        at_efforts = {effort: _fails(faulty, effort, traded.check) for effort in EFFORTS}
        within = {reach.budget: _fails(faulty, reach.density, traded.check, reach.windows) for reach in reached}
    return at_efforts | within


def _fails(path: Path, effort: Effort, check: str, windows: int | None = None) -> bool:
    """Whether a check fails at an effort, or at its density over the first windows that a budget visits."""
    options = CheckOptions(evidence=None, effort=effort, select=(check,))
    survey = survey_of(path, select_checks(options.select, ()), options, quiet)
    if isinstance(survey, FileRun):
        return True
    if windows is not None:
        chosen = tuple(sorted(visiting_order(survey.plan.of)[:windows]))
        survey = replace(survey, plan=replace(survey.plan, chosen=chosen))
    return measure_and_assemble(survey, quiet).record.verdict == "findings"


def _reach(scene: str, budget: str) -> Reach:
    """Measure how far a budget carries in a clean sequence, with all checks in one process."""
    base = _base(scene, 0)
    reached = _kept(f"reach-{budget}-{base.stem}", lambda: _measured_reach(base, budget))
    return Reach(scene, budget, reached["density"], int(reached["windows"]), int(reached["of"]), reached["reading_s"])


def _measured_reach(base: Path, budget: str) -> dict[str, Any]:
    read = min(_read_s(base) for _ in range(3))
    with TemporaryDirectory(dir=KEPT) as folder:
        record = Path(folder) / "record.json"
        command = fedora_qa("check", str(base), "--budget", budget, "--json", str(record))
        run = run_measured(command)
        if run.code != CLEAN:
            raise RuntimeError(f"Expected {base} to be clean within {budget}, got exit code {run.code}")
        said = json.loads(record.read_text(encoding="utf-8"))["run"]["host"]["budget_reached"]
    reached = re.match(r"(?P<windows>\d+) of (?P<of>\d+) windows at the density of (?P<density>\w+)", said)
    if reached is None:
        raise RuntimeError(f"Expected a number of windows, got {said!r}")
    return {"reading_s": read, **reached.groupdict()}


def _cost(scene: str, effort: Effort, size: Size = SIZE) -> Cost:
    """Measure a check of everything in one clean sequence, beside plain reading of all of it, both by one thread."""
    base = _base(scene, 0, size)
    values = _kept(f"cost-{effort}-{base.stem}", lambda: _measured_cost(base, effort))
    return Cost(scene, effort, **values)


def _measured_cost(base: Path, effort: Effort) -> dict[str, Any]:
    read = min(_read_s(base) for _ in range(3))
    check_file(base, CheckOptions(evidence=None, effort="quick"))  # compiled, and in memory
    began = time.process_time()
    run = check_file(base, CheckOptions(evidence=None, effort=effort))
    spent = time.process_time() - began
    survey = survey_of(base, select_checks((), ()), CheckOptions(effort=effort), quiet)
    if isinstance(survey, FileRun):
        raise RuntimeError(f"Expected {base} to open, got {survey.record.verdict}")
    return {
        "reading_s": read,
        "checking_s": spent,
        "decoded_bytes": float(run.decoded_bytes),
        "window_share": len(survey.plan.chosen) / survey.plan.of,
        "tile_share": survey.plan.sampling.tile_share,
        "seen": _seen(base, survey.plan.chosen),
        "verdict": run.record.verdict,
        "blind": float(sum(result.outcome == "not_observable" for result in run.record.results)),
    }


def _seen(base: Path, windows: Sequence[int]) -> dict[str, float]:
    """Return the share of each sampled stream's rows that lie in some windows."""
    with open_sequence(base) as sequence:
        spans = prepare(sequence, CheckOptions().memory_bytes).spans
    shares = {}
    for name, streams in SAMPLED.items():
        rows = [
            sum(stop - start for start, stop in (span.owned.get(stream, (0, 0)) for stream in streams))
            for span in spans
        ]
        shares[name] = sum(rows[window] for window in windows) / sum(rows)
    return shares


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
