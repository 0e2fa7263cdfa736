"""Checks some hundred correct files: ``python -m tests.benchmarks.false_alarms.study``, about an hour on two cores.

Writes docs/false-alarms.md. What was found of a file is kept in out/false-alarms, so that an interrupted study goes on
where it was; ``--fresh`` forgets it, as it must be after a change to the checks.
"""

import shutil
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Final

import click

from fedora_qa.judgement.verdict import DEFAULT_FALSE_ALARM_RATE
from tests.benchmarks.false_alarms.calibration import CONFIDENCE, LEVELS, Calibration, alarms, calibrations
from tests.benchmarks.false_alarms.checked import Checked, checked
from tests.benchmarks.false_alarms.combinations import COMBINATIONS, SIZE

ROOT: Final = Path(__file__).parents[3]
TARGET: Final = ROOT / "docs" / "false-alarms.md"
KEPT: Final = ROOT / "out" / "false-alarms"
LEAST_FILES: Final = 12
NOISY: Final = "noisy"

HEAD: Final = """\
# False alarms

Written by `make study-false-alarms`, {date}: {files} correct files of {kinds} kinds. Each was checked with all checks
at effort `full`. Files of one kind begin at different places of their flight and have different noise. Images have
{width}x{height} pixels and a file lasts a second, unless its name states otherwise.

{count} of {of} files failed a check. At the nominal rate of {rate:g} a file, at most {most} fail with probability
{confidence:.0%}. The true rate lies below {high:.2%} ({confidence:.0%}, Clopper and Pearson).

"""

KINDS: Final = """\
## By kind

| kind | files | clean | failed | checks not observable, mean |
| --- | --- | --- | --- | --- |
"""

PULLS: Final = """\
## Are standard errors right?

The pull of a value is its deviation from the expected value, divided by its standard error. Over correct files it has
mean 0 and spread 1, if the standard error describes noise that the file really has. It is smaller where nothing is
random. Without noise the standard error is a floor: what rounding and the finite image may cause. A bound on the
error of the model is then added to the limit (`limit` less z standard errors). Values that are the worst of several,
or whose deviation counts to one side only, are left out.

*Noisy* are files with declared noise of IMU, pose and events. *Beyond 1%* counts values that a correct standard error
gives with a probability of 1% or less. A count is bold if it is larger than the binomial distribution gives with
probability {confidence:.0%}.

| measurement | files | mean | spread | noisy: files | mean | spread | beyond 1% | beyond 0.1% |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


@click.command()
@click.option("--jobs", default=2, show_default=True, help="Processes.")
@click.option("--share", default=1.0, show_default=True, help="Of the files of each kind, for a first look.")
@click.option("--kind", "names", multiple=True, help="Only files of this kind, for a first look.")
@click.option("--fresh", is_flag=True, help="Forget what was found before.")
def main(jobs: int, share: float, names: tuple[str, ...], fresh: bool) -> None:
    """Check them all and write docs/false-alarms.md."""
    if fresh:
        shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True, exist_ok=True)
    wanted = [
        (kind, number)
        for kind in COMBINATIONS
        if not names or kind.name in names
        for number in range(max(1, round(kind.files * share)))
    ]
    found: dict[tuple[str, int], Checked] = {}
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_check_kind, kind.name, number, KEPT) for kind, number in wanted]):
            one = future.result()
            found[one.combination, one.number] = one
            click.echo(f"{len(found)}/{len(wanted)} {one.combination} {one.number}: {one.verdict}", err=True)
            for alarm in one.alarms:
                click.echo(f"  {alarm}", err=True)
    text = "".join(page([found[kind.name, number] for kind, number in wanted]))
    if share == 1.0 and not names:
        TARGET.write_text(text, encoding="utf-8")
    click.echo(text)


def _check_kind(name: str, number: int, folder: Path) -> Checked:
    """Check a file of the kind with this name: the functions that a kind holds cannot be sent to a process."""
    (kind,) = (kind for kind in COMBINATIONS if kind.name == name)
    return checked(kind, number, folder)


def page(files: Sequence[Checked]) -> Iterator[str]:
    """Text of docs/false-alarms.md."""
    failed = alarms(files, DEFAULT_FALSE_ALARM_RATE)
    names = dict.fromkeys(one.combination for one in files)
    yield HEAD.format(
        date=time.strftime("%Y-%m-%d"),
        files=len(files),
        kinds=len(names),
        width=SIZE[0],
        height=SIZE[1],
        count=failed.count,
        of=failed.of,
        rate=failed.rate,
        most=failed.most,
        confidence=CONFIDENCE,
        high=failed.interval[1],
    )
    yield KINDS
    for name in names:
        yield _kind([one for one in files if one.combination == name])
    yield "\n"
    yield from _failures(files)
    yield PULLS.format(confidence=CONFIDENCE)
    noisy = {one.name: one for one in calibrations((one for one in files if NOISY in one.combination), LEAST_FILES)}
    for calibration in calibrations((one for one in files if NOISY not in one.combination), LEAST_FILES):
        yield _row(calibration.name, calibration, noisy.pop(calibration.name, None))
    for name, calibration in noisy.items():
        yield _row(name, None, calibration)


def _kind(files: Sequence[Checked]) -> str:
    clean = sum(one.verdict == "clean" for one in files)
    failed = sum(bool(one.alarms) for one in files)
    blind = sum(outcome == "not_observable" for one in files for outcome in one.outcomes.values()) / len(files)
    return f"| {files[0].combination} | {len(files)} | {clean} | {failed} | {blind:.1f} |\n"


def _failures(files: Sequence[Checked]) -> Iterator[str]:
    failed = [one for one in files if one.alarms]
    if not failed:
        return
    yield "What failed:\n\n"
    for one in failed:
        for alarm in one.alarms:
            yield f"- {one.combination}, file {one.number}: {' '.join(alarm.split())[:300]}\n"
    yield "\n"


def _row(name: str, quiet: Calibration | None, noisy: Calibration | None) -> str:
    first = f"{len(quiet.pulls)} | {quiet.mean:+.2f} | {quiet.spread:.2f}" if quiet else " | | "
    if noisy is None:
        return f"| {name} | {first} | | | | | |\n"
    shares = " | ".join(_share(noisy, level) for level in LEVELS)
    spread = f"{noisy.spread:.2f} +- {noisy.spread_error:.2f}"
    return f"| {name} | {first} | {len(noisy.pulls)} | {noisy.mean:+.2f} | {spread} | {shares} |\n"


def _share(calibration: Calibration, level: float) -> str:
    share = calibration.beyond(level)
    return str(share.count) if share.agrees else f"**{share.count}**"


if __name__ == "__main__":
    main()
