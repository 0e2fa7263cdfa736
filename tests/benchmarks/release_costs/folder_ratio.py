"""How much longer a check of a folder in the layout of DSEC takes than decoding it: ``python -m`` this module.

Within a turn the folder is decoded and checked one after the other, so that a slower machine slows both.
"""

from statistics import median

import click

from fedora_qa.cli.exit_codes import CLEAN
from tests.benchmarks.full_size.measured_run import fedora_qa, run_measured
from tests.benchmarks.full_size.study import JOBS
from tests.benchmarks.release_costs.folder_reading import reading_s
from tests.benchmarks.release_costs.study import EFFORTS, dsec_like


@click.command()
@click.option("--length", "length_s", default=4.0, show_default=True, help="Seconds of the sequence.")
@click.option("--turns", default=5, show_default=True, help="How often all is measured.")
def main(length_s: float, turns: int) -> None:
    """Print the ratios of every turn, and their medians."""
    folder = dsec_like(length_s)
    ratios: dict[str, list[float]] = {effort: [] for effort in EFFORTS}
    for turn in range(turns):
        decoding_s = reading_s(folder)
        for effort in EFFORTS:
            run = run_measured(fedora_qa("check", str(folder), "--effort", effort, "--jobs", str(JOBS)))
            if run.code != CLEAN:
                raise RuntimeError(f"Expected exit code {CLEAN} for {folder}, got {run.code}")
            ratios[effort].append(run.wall_s / decoding_s)
        taken = ", ".join(f"{effort} {values[-1]:.2f}" for effort, values in ratios.items())
        click.echo(f"turn {turn}: decoding {decoding_s:.2f} s, {taken}")
    for effort, values in ratios.items():
        click.echo(f"{effort}: {median(values):.2f} times ({min(values):.2f} to {max(values):.2f})")


if __name__ == "__main__":
    main()
