"""Text of docs/learning.md, and the published prices, of the results that are there."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from textwrap import wrap
from typing import Final

from fedora_qa.scoring.fault_prices import FaultPrice, FaultPrices
from tests.benchmarks.learning.budget import BATCH, BINS, BUDGETS, COLOUR_SIZE, EVENT_SIZE, FLIGHT_S, Budget
from tests.benchmarks.learning.flights import MOTION_KINDS, REGIONS_M, THRESHOLD, MotionKind
from tests.benchmarks.learning.planted import PLANTED, PlantedFault
from tests.benchmarks.learning.price import (
    CONFIDENCE,
    METRICS,
    Cost,
    costs_of,
    least_costly_size,
    material_size,
    mean_interval,
)
from tests.benchmarks.learning.results import Results
from tests.benchmarks.learning.runs import RATES_HZ, Arrangement, Sampling, arrangements_of

CORRECT: Final = Arrangement("flying")

PAPER_FLOW: Final = {10: (18.841, 13.44, 0.794), 25: (10.392, 5.30, 0.51), 50: (6.15, 2.448, 0.398)}
"""Mean flow px, AEE px and NAEE of the FEDORA paper, by rate."""
PAPER_CROSS_FLOW: Final = {
    ("flying", "flying"): 0.794,
    ("driving", "driving"): 0.2211,
    ("driving", "flying"): 1.346,
    ("flying", "driving"): 2.77,
}
"""NAEE of the paper by what was trained and tested on: FEDORA is flying, DSEC driving."""
PAPER_CROSS_DISPARITY: Final = {
    ("flying", "flying"): 0.2689,
    ("driving", "driving"): 0.1765,
    ("driving", "flying"): 45.1552,
    ("flying", "driving"): 0.6769,
}
PAPER_POSE: Final = {"nae_position": 0.0206, "nae_orientation": 0.0754}

WIDTH: Final = 118
"""Most characters of a line of prose."""

HEAD: Final = """\
# What a dataset teaches, and what a fault costs

Written by `make study-learning`. The FEDORA paper trains networks for flow, disparity and pose, and compares them by
NAEE, NADE and NAE ([definitions](score.md#the-errors)). This study asks the same of generated flights, beside
predictors that look at no events, and then what one fault in the training data costs.

{status}

## What is trained

- *Flights*: {flight:g} s each, {width}x{height} pixels of depth and flow, {event_width}x{event_height} of events (log
  sensor, {threshold:g} nat). *Flying*: the paper's first two sequences in gusts, six degrees of freedom, up to 5 m/s.
  *Driving*: the scene `racetrack-drive` on the same avenue, planar position and yaw, 6 to 14 m/s, the camera at 1.5
  m. World, light and sensor are the same; only the motion differs.
- *Splits*: {train} flights of a kind to train on, {validation} for early stopping, {test} to test on. Test flights
  are between {test_low:g} and {test_high:g} m along the avenue, all others between {train_low:g} and {train_high:g}
  m.
- *Input*: the events of an interval as a voxel grid of {bins} bins, bilinear in time (Zhu et al., CVPR 2019).
- *Network*: one encoder of four convolutions, a decoder each for flow, for disparity at the interval's start, and for
  the motion over the interval; all are trained together. The loss is NAEE + NADE + the mean of both NAE, on the
  training set's own means.
- *Training*: Adam from 3e-3 along a cosine, at most {steps} steps of {batch} samples, whatever the number of samples;
  half of them mirrored left to right. The validation loss is taken every {every} steps; training stops after
  {patience} times without a lower one, and the best network counts. Validation flights have the fault of the training
  flights.
- *Score*: `fedora_qa.score` on the test flights, which are correct. Flow and disparity are enlarged to the colour
  camera. Errors are averages over all test flights, divided by the average truth.
- Runs differ by their seed (initial weights, order, mirroring). Intervals of part a to c are {confidence:.0%}, by
  Student's t over the seeds; the flights are the same in all runs, so intervals do not cover another choice of
  flights.
"""

CANNOT_TELL: Final = """
## What this cannot tell

- The network has about {parameters} parameters and sees {event_width}x{event_height} pixels. A large network on large
  images learns finer things, and may suffer from faults that are lost here.
- No cost beyond the scatter is no proof that a fault is harmless. A material size is never loosened by this study.
- Within a second the motion changes little, and neighbouring intervals are alike: a delay, or flow of another interval,
  costs less than it would where motion is abrupt.
- All flights are of one generated world. Nothing was measured on real recordings.
- The paper trains on whole sequences of its own worlds, with DSEC as the driving data: another place, sensor and
  rate. Its figures stand beside ours to compare directions, not sizes.
- Error measures are ratios to a mean truth; they compare rates and datasets only beside a trivial predictor.
"""


def page(results: Results, budget_name: str, parameters: int) -> str:
    """Text of docs/learning.md."""
    return _reflowed("".join(_sections(results, budget_name, parameters)))


def _reflowed(text: str) -> str:
    """Return Markdown with every paragraph and item in lines of ``WIDTH``."""
    lines: list[str] = []
    for line in text.split("\n"):
        continues = line and not line.startswith(("|", "#", "- "))
        if continues and lines and lines[-1] and not lines[-1].startswith(("|", "#")):
            lines[-1] += f" {line.strip()}"
        else:
            lines.append(line)
    return "\n".join(
        line
        if not line or line.startswith(("|", "#"))
        else "\n".join(
            wrap(
                line,
                WIDTH,
                subsequent_indent="  " if line.startswith("- ") else "",
                break_long_words=False,
                break_on_hyphens=False,
            )
        )
        for line in lines
    )


def _sections(results: Results, budget_name: str, parameters: int) -> Iterator[str]:
    budget = BUDGETS[budget_name]
    (train_low, train_high), (test_low, test_high) = REGIONS_M["train"], REGIONS_M["test"]
    yield HEAD.format(
        status=_status(results, budget_name, budget),
        flight=FLIGHT_S,
        width=COLOUR_SIZE[0],
        height=COLOUR_SIZE[1],
        event_width=EVENT_SIZE[0],
        event_height=EVENT_SIZE[1],
        threshold=THRESHOLD,
        train=budget.train,
        validation=budget.validation,
        test=budget.test,
        train_low=train_low,
        train_high=train_high,
        test_low=test_low,
        test_high=test_high,
        bins=BINS,
        batch=BATCH,
        steps=budget.steps,
        every=budget.evaluate_every,
        patience=budget.patience,
        confidence=CONFIDENCE,
    )
    yield from _findings(results, budget)
    yield from _rates(results, budget)
    yield from _cross_tests(results, budget)
    yield from _pose(results, budget)
    yield from _prices(results, budget)
    yield CANNOT_TELL.format(
        parameters=f"{round(parameters, -3):,}", event_width=EVENT_SIZE[0], event_height=EVENT_SIZE[1]
    )


def _status(results: Results, budget_name: str, budget: Budget) -> str:
    """Return what was run, and what was not."""
    lines = []
    every = [result for part in ("a", "b", "c", "price") for result in _part_results(results, part, budget)]
    dates = sorted({str(result["date"]) for result in every})
    devices = ", ".join(sorted({str(result["device"]) for result in every})) or "none"
    span = " to ".join(dict.fromkeys((dates[0], dates[-1]))) if dates else "not run"
    lines.append(f"`make study-learning BUDGET={budget_name}`, {span}, device: {devices}.\n")
    lines.append("| part | networks that were trained | of | hours of training |\n| --- | --- | --- | --- |")
    for part, title in (
        ("a", "a, rates of flow"),
        ("b", "b, flying and driving"),
        ("c", "c, pose"),
        ("price", "price of a fault"),
    ):
        present = _part_results(results, part, budget)
        planned = sum(_seeds(part, each, budget) for each in arrangements_of(part))
        hours = sum(float(result["seconds"]) for result in present) / 3600
        lines.append(f"| {title} | {len(present)} | {planned} | {hours:.2f} |")
    lines.append("\nParts share networks: b and c those of both kinds, all of them the flying ones on correct data.")
    if every:
        cut = sum(result["best_step"] == budget.steps for result in every)
        lines.append(
            f"In {cut / len(every):.0%} of the runs the last step had the least validation loss: the budget ended them."
        )
    if budget_name != "full":
        full = BUDGETS["full"]
        lines.append(
            f"The full study was not run: {full.train} flights of a kind to train on, {full.steps} steps, "
            f"{full.seeds} seeds (`--budget full`)."
        )
    return "\n".join(lines)


def _part_results(results: Results, part: str, budget: Budget) -> list[Mapping[str, object]]:
    return [result for each in arrangements_of(part) for result in results.of(each, _seeds(part, each, budget))]


def _seeds(part: str, arrangement: Arrangement, budget: Budget) -> int:
    return budget.control_seeds if part == "price" and arrangement.fault is None else budget.seeds


def _findings(results: Results, budget: Budget) -> Iterator[str]:
    """Yield which findings of the paper hold here; those whose runs are not there are left out."""

    def interval(metric: str, trained: Arrangement, tested: MotionKind = "flying") -> tuple[float, float] | None:
        of_runs = results.errors(trained, budget.seeds, metric, tested)
        return mean_interval(of_runs) if len(of_runs) > 1 else None

    rows = []
    for sampling in ("iso-time", "iso-sample"):
        ends = interval("naee", CORRECT), interval("naee", Arrangement("flying", RATES_HZ[-1], sampling))
        first, last = ends
        if first and last:
            rows.append(
                (f"NAEE of flow falls from 10 to 50 Hz, {sampling}", "0.794 to 0.398", ends, _trend(first, last) < 0)
            )
    for metric, what, paper in (
        ("naee", "flow", PAPER_CROSS_FLOW),
        ("nade", "disparity", PAPER_CROSS_DISPARITY),
    ):
        for tested in MOTION_KINDS:
            (other,) = (kind for kind in MOTION_KINDS if kind != tested)
            ends = interval(metric, Arrangement(tested), tested), interval(metric, Arrangement(other), tested)
            first, last = ends
            if first and last:
                rows.append(
                    (
                        f"{other.capitalize()} does not replace {tested} for {what}: {METRICS[metric]} rises",
                        f"{paper[tested, tested]} to {paper[other, tested]}",
                        ends,
                        _trend(first, last) > 0,
                    )
                )
    crossed = [interval("naee", Arrangement(a), b) for a, b in (("driving", "flying"), ("flying", "driving"))]
    first, last = crossed
    if first and last:
        holds = all(mean - half > 1 for mean, half in (first, last))
        rows.append(
            ("Flow that is learned from the other motion is worse than zero flow", "1.346, 2.77", crossed, holds)
        )
    if rows:
        yield "\n## Which findings hold\n\n| finding of the paper | paper | here | holds |\n| --- | --- | --- | --- |\n"
    for finding, paper_words, ends, holds in rows:
        here = ", ".join(_plus_minus(end) for end in ends)
        yield f"| {finding} | {paper_words} | {here} | {'yes' if holds else 'no'} |\n"


def _rates(results: Results, budget: Budget) -> Iterator[str]:
    yield "\n## a. Flow at 10, 25 and 50 Hz\n\n"
    base = results.trivial(CORRECT)
    if base is None:
        yield "Not run.\n"
        return
    yield (
        "*Iso-time*: every interval of every flight, so that a higher rate has more samples. *Iso-sample*: as many "
        "intervals as at 10 Hz, the first of each flight. *Constant* predicts the mean flow vector of the training "
        "set, *mean field* the mean of each pixel. Zero flow has a NAEE of 1 by definition.\n\n"
        "| rate | sampling | samples | mean flow, px | AEE, px | NAEE | constant | mean field | NAEE / mean field "
        "|\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    naee: dict[tuple[Sampling, int], tuple[float, float]] = {}
    sizes_px: dict[int, tuple[float, float]] = {}
    for sampling in ("iso-time", "iso-sample"):
        for rate in RATES_HZ:
            arrangement = Arrangement("flying", rate, sampling if rate != RATES_HZ[0] else "iso-time")
            present, trivial = results.of(arrangement, budget.seeds), results.trivial(arrangement)
            if not present or trivial is None:
                yield f"| {rate} Hz | {sampling} | not run | | | | | | |\n"
                continue
            values = [result["errors"]["flying"] for result in present]
            naee[sampling, rate] = mean_interval([value["naee"] for value in values])
            if sampling == "iso-time":
                sizes_px[rate] = (values[0]["mean_flow_px"], mean_interval([value["aee_px"] for value in values])[0])
            field = trivial["mean field"]["flying"]["naee"]
            yield (
                f"| {rate} Hz | {sampling} | {present[0]['samples']} | {values[0]['mean_flow_px']:.2f} | "
                f"{mean_interval([value['aee_px'] for value in values])[0]:.2f} | "
                f"{_plus_minus(naee[sampling, rate])} | {trivial['constant']['flying']['naee']:.3f} | {field:.3f} | "
                f"{naee[sampling, rate][0] / field:.3f} |\n"
            )
    yield ("\nThe paper:\n\n| rate | mean flow, px | AEE, px | NAEE |\n| --- | --- | --- | --- |\n")
    for rate, (mean_flow, aee, printed) in PAPER_FLOW.items():
        yield f"| {rate} Hz | {mean_flow} | {aee} | {printed} |\n"
    yield "\n"
    for sampling in ("iso-time", "iso-sample"):
        first, last = naee.get((sampling, RATES_HZ[0])), naee.get((sampling, RATES_HZ[-1]))
        if first and last:
            trend = _direction(first, last)
            yield f"- {sampling}: NAEE {trend} from 10 to 50 Hz; the paper's falls from 0.794 to 0.398.\n"
    if {RATES_HZ[0], RATES_HZ[-1]} <= set(sizes_px):
        (flow, aee), (slow_flow, slow_aee) = sizes_px[RATES_HZ[0]], sizes_px[RATES_HZ[-1]]
        (paper_flow, paper_aee, _), (paper_slow_flow, paper_slow_aee, _) = PAPER_FLOW[10], PAPER_FLOW[50]
        yield (
            f"- Why: from 10 to 50 Hz the mean flow falls as well, by a factor of {flow / slow_flow:.2f}, and AEE by "
            f"{aee / slow_aee:.2f}; in the paper by {paper_flow / paper_slow_flow:.2f} and "
            f"{paper_aee / paper_slow_aee:.2f}. NAEE falls only where errors fall faster than the motion. A shorter "
            "interval has less motion and fewer events to tell it from.\n"
        )
    time, sample = naee.get(("iso-time", RATES_HZ[-1])), naee.get(("iso-sample", RATES_HZ[-1]))
    if time and sample:
        trend = _direction(sample, time)
        yield f"- At 50 Hz NAEE {trend} from iso-sample to iso-time: what more time and samples give.\n"


def _cross_tests(results: Results, budget: Budget) -> Iterator[str]:
    yield "\n## b. Flying and driving\n\n"
    if any(results.trivial(Arrangement(kind)) is None for kind in MOTION_KINDS):
        yield "Not run.\n"
        return
    yield (
        "The paper has FEDORA for flying and DSEC for driving. *Mean field* predicts the mean flow, or disparity, "
        "of each pixel in the set that is trained on.\n\n"
        "| trained on | tested on | NAEE | mean field | paper's NAEE | NADE | mean field | paper's NADE |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    errors: dict[tuple[str, MotionKind, MotionKind], tuple[float, float]] = {}
    for trained in MOTION_KINDS:
        trivial = results.trivial(Arrangement(trained)) or {}
        for tested in MOTION_KINDS:
            for metric in ("naee", "nade"):
                of_runs = results.errors(Arrangement(trained), budget.seeds, metric, tested)
                errors[metric, trained, tested] = mean_interval(of_runs) if of_runs else (math.nan, math.nan)
            field = trivial["mean field"][tested]
            yield (
                f"| {trained} | {tested} | {_plus_minus(errors['naee', trained, tested])} | {field['naee']:.3f} | "
                f"{PAPER_CROSS_FLOW[trained, tested]} | {_plus_minus(errors['nade', trained, tested])} | "
                f"{field['nade']:.3f} | {PAPER_CROSS_DISPARITY[trained, tested]} |\n"
            )
    yield "\n"
    for metric, what in (("naee", "flow"), ("nade", "disparity")):
        for tested in MOTION_KINDS:
            (other,) = (kind for kind in MOTION_KINDS if kind != tested)
            own, foreign = errors[metric, tested, tested], errors[metric, other, tested]
            yield (
                f"- {what.capitalize()}, tested on {tested}: {METRICS[metric]} {_direction(own, foreign)} from "
                f"training on {tested} to training on {other}, by a factor of {foreign[0] / own[0]:.2f}.\n"
            )


def _pose(results: Results, budget: Budget) -> Iterator[str]:
    yield "\n## c. Pose\n\n"
    if any(results.trivial(Arrangement(kind)) is None for kind in MOTION_KINDS):
        yield "Not run.\n"
        return
    yield (
        "NAE of the motion over 0.1 s, translation and rotation from the body at the start to the body at the end. "
        "*Constant* predicts the mean motion of the set that is trained on; zero motion has 1. The paper's figures "
        "are 0.0206 for position and 0.0754 for orientation; it does not say by which numbers a pose is "
        "represented, and a pose in the world can have any mean, so the two are not comparable "
        "([score](score.md#the-papers-figures)).\n\n"
        "| trained on | tested on | NAE, position | constant | NAE, orientation | constant |\n"
        "| --- | --- | --- | --- | --- | --- |\n"
    )
    for trained in MOTION_KINDS:
        trivial = results.trivial(Arrangement(trained)) or {}
        for tested in MOTION_KINDS:
            cells = []
            for metric in PAPER_POSE:
                of_runs = results.errors(Arrangement(trained), budget.seeds, metric, tested)
                cells += [_plus_minus(mean_interval(of_runs)), f"{trivial['constant'][tested][metric]:.3f}"]
            yield f"| {trained} | {tested} | {' | '.join(cells)} |\n"


def _prices(results: Results, budget: Budget) -> Iterator[str]:
    yield "\n## The price of a fault\n\n"
    costs = measured_costs(results, budget)
    if not costs:
        yield "Not run.\n"
        return
    correct = {
        metric: mean_interval(results.errors(CORRECT, budget.control_seeds, metric, "flying")) for metric in METRICS
    }
    yield (
        "Flying at 10 Hz, all flights for training and validation with one fault, the test flights correct. Cost: "
        f"the mean error less that of networks trained on correct data ({budget.control_seeds} of them, "
        f"{budget.seeds} with each fault). Intervals are Dunnett's, {CONFIDENCE:.0%} for all faults of a column "
        "together; **bold**: the cost leaves the noise, the interval is above 0. The first row is the error on "
        "correct data.\n\n"
        f"| fault | made | {' | '.join(METRICS.values())} |\n"
        f"| --- | --- |{' --- |' * len(METRICS)}\n"
        f"| none | | {' | '.join(_plus_minus(correct[metric]) for metric in METRICS)} |\n"
    )
    for fault in PLANTED:
        of_fault = costs.get(fault)
        cells = [_cost_cell(of_fault[metric]) for metric in METRICS] if of_fault else ["not run"] + [""] * 3
        yield f"| {_fault_words(fault)} | {_made_words(fault)} | {' | '.join(cells)} |\n"
    yield (
        "\n"
        "*Generator*: planted in copies of the files by `fedora-generate fault`. *Arrays*: made in the arrays of "
        "events or poses that were read, where the generator plants the fault in one place only. *Anew*: half of "
        "the sequences are generated again with other thresholds. Index maps only matter where events are taken by "
        "them, as in these rows; elsewhere events are taken by their timestamps.\n"
    )
    lower = [
        f"{_fault_words(fault)} ({METRICS[metric]})"
        for fault, of_fault in costs.items()
        for metric, cost in of_fault.items()
        if cost.high < 0
    ]
    if lower:
        yield (
            f"\nBeyond the scatter the error is *lower* with: {'; '.join(lower)}. On test flights over other ground a "
            "network has a bias, and a fault may happen to act against it. That is no merit of the fault.\n"
        )
    yield from _material_rows(costs)


def _material_rows(costs: Mapping[PlantedFault, Mapping[str, Cost]]) -> Iterator[str]:
    yield (
        "\n"
        "### Against the material sizes\n\n"
        "The profile `training` says from which size a deviation matters to those who train "
        "([materiality](../fedora_qa/judgement/materiality.toml)). A row is tightened where a smaller size costs "
        "beyond the noise, and never loosened.\n\n"
        "| fault | code | material size | costs beyond the noise | row |\n"
        "| --- | --- | --- | --- | --- |\n"
    )
    for (text, unit), group in groupby(PLANTED, key=lambda fault: (fault.text, fault.unit)):
        faults = [fault for fault in group if fault in costs]
        if not faults:
            continue
        material = material_size(faults[0])
        leaves = [fault for fault in faults if any(cost.leaves_noise for cost in costs[fault].values())]
        if faults[0].size is None:
            cost_words = "yes" if leaves else "no"
            least = None
        else:
            sizes = {
                metric: least_costly_size({fault.size or 0.0: costs[fault][metric] for fault in faults})
                for metric in METRICS
            }
            present = [size for size in sizes.values() if size is not None]
            least = min(present, default=None)
            cost_words = f"from {least:g} {unit} on" if least is not None else f"at none of {_size_list(faults)}"
        if material is None:
            code, size_words, verdict = (
                ", ".join(faults[0].codes) or "none",
                "none in this unit",
                "no row to hold against",
            )
        else:
            code, size = material
            size_words = "every deviation" if size == 0 else f"{size:g} {unit}".rstrip()
            tighter = size > 0 and least is not None and least < size
            verdict = f"to tighten, to {least:g} {unit}" if tighter else "stays"
        yield f"| {text} | {code} | {size_words} | {cost_words} | {verdict} |\n"


def measured_costs(results: Results, budget: Budget) -> dict[PlantedFault, dict[str, Cost]]:
    """Return the costs, by error measure, of faults whose runs are complete; none without those on correct data."""
    complete = [
        fault for fault in PLANTED if len(results.of(Arrangement("flying", fault=fault), budget.seeds)) == budget.seeds
    ]
    if len(results.of(CORRECT, budget.control_seeds)) < budget.control_seeds:
        return {}
    by_metric = {
        metric: costs_of(
            results.errors(CORRECT, budget.control_seeds, metric, "flying"),
            {
                fault.name: results.errors(Arrangement("flying", fault=fault), budget.seeds, metric, "flying")
                for fault in complete
            },
        )
        for metric in METRICS
    }
    return {fault: {metric: by_metric[metric][fault.name] for metric in METRICS} for fault in complete}


def fault_prices(results: Results, budget_name: str) -> FaultPrices:
    """Return what is published of the prices."""
    budget = BUDGETS[budget_name]
    costs = measured_costs(results, budget)
    correct = {metric: results.errors(CORRECT, budget.control_seeds, metric, "flying") for metric in METRICS}
    dates = sorted(
        str(result["date"])
        for fault in costs
        for result in results.of(Arrangement("flying", fault=fault), budget.seeds)
    )
    return FaultPrices(
        date=dates[-1] if dates else "",
        flights=budget.train,
        networks=budget.seeds,
        correct_networks=budget.control_seeds,
        prices=tuple(
            FaultPrice(
                fault=fault.text,
                cause=fault.cause,
                size=fault.size,
                unit=fault.unit,
                checks=tuple(dict.fromkeys(code.rpartition(".")[0] for code in fault.codes)),
                metric=METRICS[metric],
                correct=round(sum(correct[metric]) / len(correct[metric]), 4),
                cost=round(cost.cost, 4),
                low=round(cost.low, 4),
                high=round(cost.high, 4),
            )
            for fault, of_fault in costs.items()
            for metric, cost in of_fault.items()
        ),
    )


def _fault_words(fault: PlantedFault) -> str:
    return fault.text if fault.size is None else f"{fault.text}, {fault.size:g} {fault.unit}"


def _made_words(fault: PlantedFault) -> str:
    return {"file": "generator", "arrays": "arrays", "generating": "anew"}[fault.made]


def _size_list(faults: Sequence[PlantedFault]) -> str:
    return ", ".join(f"{fault.size:g}" for fault in faults) + f" {faults[0].unit}"


def _cost_cell(cost: Cost) -> str:
    text = f"{cost.cost:+.3f} ({cost.low:+.3f} to {cost.high:+.3f})"
    return f"**{text}**" if cost.leaves_noise else text


def _plus_minus(interval: tuple[float, float]) -> str:
    mean, half = interval
    if math.isnan(mean):
        return "not run"
    return f"{mean:.3f}" if math.isnan(half) else f"{mean:.3f} ± {half:.3f}"


def _direction(first: tuple[float, float], second: tuple[float, float]) -> str:
    """Return whether a mean rises or falls beyond both intervals."""
    trend = _trend(first, second)
    if not trend:
        return f"does not change beyond the intervals ({first[0]:.3f} and {second[0]:.3f})"
    return f"{'rises' if trend > 0 else 'falls'} ({first[0]:.3f} to {second[0]:.3f})"


def _trend(first: tuple[float, float], second: tuple[float, float]) -> int:
    """Return 1 where a mean rises beyond both intervals, -1 where it falls, else 0."""
    if abs(second[0] - first[0]) > first[1] + second[1]:
        return 1 if second[0] > first[0] else -1
    return 0
