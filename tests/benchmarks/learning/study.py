"""What a dataset teaches, and what a fault costs a learner: ``make study-learning`` writes docs/learning.md.

Flights are generated, networks trained on them, and their predictions scored by ``fedora_qa.score``. The result of each
run lies in out/learning, so that an interrupted study goes on where it was; ``--fresh`` forgets it, but for the
flights: after a change to these, remove the folder. It needs PyTorch, and uses a GPU where there is one.
"""

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import click
import torch

from fedora_qa.scoring.fault_prices import write_fault_prices
from tests.benchmarks.learning.budget import BUDGETS, Budget
from tests.benchmarks.learning.flights import FlightDraw, MotionKind, draws_of
from tests.benchmarks.learning.network import parameter_count, predict
from tests.benchmarks.learning.page import fault_prices, page
from tests.benchmarks.learning.planted import faulty_samples
from tests.benchmarks.learning.results import RESULTS, ROOT, Results, trivial_name
from tests.benchmarks.learning.runs import PARTS, Arrangement, Part, TrainingRun, runs_of
from tests.benchmarks.learning.samples import Samples, read_samples
from tests.benchmarks.learning.scores import errors_of, trivial_predictions
from tests.benchmarks.learning.training import train
from tests.benchmarks.processes import in_processes

TARGET: Final = ROOT / "docs" / "learning.md"


@click.command()
@click.option("--budget", "budget_name", type=click.Choice(tuple(BUDGETS)), default="full", show_default=True)
@click.option("--parts", default=",".join(PARTS), show_default=True, help="Comma-separated.")
@click.option("--processes", default=2, show_default=True, help="Networks that are trained at a time.")
@click.option("--fresh", is_flag=True, help="Forget the results of before, but for the flights.")
@click.option("--page", "target", type=click.Path(path_type=Path), default=TARGET, show_default=True)
@click.option("--publish", type=click.Path(path_type=Path), help="Write the prices of faults here, for `explain`.")
def main(budget_name: str, parts: str, processes: int, fresh: bool, target: Path, publish: Path | None) -> None:
    """Generate, train, score, and write the page of what is there."""
    budget, results = BUDGETS[budget_name], Results(RESULTS / budget_name)
    for former in results.folder.glob("*.json") if fresh else ():
        former.unlink()
    results.flights.mkdir(parents=True, exist_ok=True)
    groups = _missing([part for part in PARTS if part in parts.split(",")], budget, results)
    in_processes(
        processes, partial(_generate, results), _draws([runs[0].arrangement for runs in groups], budget), _report
    )
    in_processes(processes, partial(_train_all, results, budget), groups, _report)
    target.write_text(page(results, budget_name, parameter_count()), encoding="utf-8")
    click.echo(f"{target} written", err=True)
    prices = fault_prices(results, budget_name)
    if publish is not None and prices.prices:
        write_fault_prices(prices, publish)


def _missing(parts: Sequence[Part], budget: Budget, results: Results) -> list[tuple[TrainingRun, ...]]:
    """Return the runs of some parts that have no result yet, at most ``budget.seeds`` on the same data together."""
    by_data: dict[Arrangement, dict[TrainingRun, None]] = {}
    for runs in (runs for part in parts for runs in runs_of(part, budget)):
        by_data.setdefault(runs[0].arrangement, {}).update(
            dict.fromkeys(run for run in runs if not results.holds(run.name))
        )
    most = budget.seeds
    return [tuple(runs)[first : first + most] for runs in by_data.values() for first in range(0, len(runs), most)]


def _draws(arrangements: Sequence[Arrangement], budget: Budget) -> list[FlightDraw]:
    kinds = dict.fromkeys(kind for each in arrangements for kind in (each.kind, *each.tested_on))
    return [draw for kind in kinds for draws in _splits(kind, budget) for draw in draws]


def _splits(kind: MotionKind, budget: Budget) -> tuple[tuple[FlightDraw, ...], ...]:
    return (
        draws_of(kind, "train", budget.train),
        draws_of(kind, "validation", budget.validation),
        draws_of(kind, "test", budget.test),
    )


def _generate(results: Results, draw: FlightDraw) -> str:
    draw.write(results.flights / f"{draw.name}.h5")
    return draw.name


def _train_all(results: Results, budget: Budget, runs: tuple[TrainingRun, ...]) -> str:
    """Train and score the networks of some runs on the same data, one after the other."""
    torch.set_num_threads(1)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    arrangement = runs[0].arrangement
    training, validation = (
        faulty_samples(arrangement.fault, draws, results.flights, arrangement.rate_hz, arrangement.most)
        for draws in _splits(arrangement.kind, budget)[:2]
    )
    tests: dict[MotionKind, list[Path]] = {
        kind: [results.flights / f"{draw.name}.h5" for draw in _splits(kind, budget)[2]]
        for kind in arrangement.tested_on
    }
    inputs = {kind: [read_samples(path, arrangement.rate_hz) for path in paths] for kind, paths in tests.items()}
    with TemporaryDirectory(dir=results.folder) as scratch:
        without_network = arrangement.fault is None and arrangement.sampling == "iso-time"
        if without_network and not results.holds(trivial_name(arrangement)):
            results.write(trivial_name(arrangement), _trivial(arrangement, training, tests, inputs, Path(scratch)))
        for run in runs:
            began = time.monotonic()
            trained = train(training, validation, budget, run.seed, device)
            errors = {}
            for kind, paths in tests.items():
                predicted = [
                    predict(trained.network, torch.from_numpy(each.voxels).to(device)) for each in inputs[kind]
                ]
                errors[kind] = errors_of(predicted, paths, arrangement.rate_hz, Path(scratch)).to_json()
            results.write(
                run.name,
                {
                    "samples": len(training),
                    "steps": trained.steps,
                    "best_step": trained.best_step,
                    "validation_loss": trained.validation_loss,
                    "device": torch.cuda.get_device_name() if device == "cuda" else device,
                    "seconds": round(time.monotonic() - began, 1),
                    "date": time.strftime("%Y-%m-%d"),
                    "errors": errors,
                },
            )
    return f"{arrangement.name}, {len(runs)} runs"


def _trivial(
    arrangement: Arrangement,
    training: Samples,
    tests: Mapping[MotionKind, Sequence[Path]],
    inputs: Mapping[MotionKind, Sequence[Samples]],
    scratch: Path,
) -> dict[str, Any]:
    """Return the errors of the predictors that look at no events, by predictor and kind of the test flights."""
    errors: dict[str, dict[str, Any]] = {}
    for kind, paths in tests.items():
        (intervals,) = {len(each) for each in inputs[kind]}
        for name, predicted in trivial_predictions(training.targets, intervals).items():
            scored = errors_of([predicted] * len(paths), paths, arrangement.rate_hz, scratch)
            errors.setdefault(name, {})[kind] = scored.to_json()
    return errors


def _report(number: str, done: str) -> None:
    click.echo(f"{number} {done}", err=True)


if __name__ == "__main__":
    main()
