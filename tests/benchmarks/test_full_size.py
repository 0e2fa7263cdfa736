"""The page of full-size files tells each time as a ratio to decoding, and a run is measured with all its processes."""

import sys

from tests.benchmarks.full_size.figures import OfEffort, OnCluster, Reading, Selection, Statistic, Study, Turn
from tests.benchmarks.full_size.machine import DECODING, Machine
from tests.benchmarks.full_size.measured_run import Run, run_measured
from tests.benchmarks.full_size.page import page

CHILD = """
import time
held = b"x" * 60_000_000
until = time.process_time() + 0.5
while time.process_time() < until:
    pass
"""
HOLDS_AND_SPENDS = f"""
import subprocess, sys
held = b"x" * 40_000_000
subprocess.run([sys.executable, "-c", {CHILD!r}], check=True)
sys.exit(3)
"""


def test_a_run_counts_what_its_children_hold_and_spend() -> None:
    """40 MB in the parent, 60 MB and half a second of processor in its child."""
    run = run_measured([sys.executable, "-c", HOLDS_AND_SPENDS])
    assert run.code == 3
    assert run.peak_bytes > 100_000_000
    assert run.cpu_s > 0.5
    assert run.wall_s > 0.5


ORPHANED = f"""
import subprocess, sys, time
subprocess.Popen([sys.executable, "-c", {CHILD!r}])
time.sleep(3)
"""


def test_a_run_counts_what_is_spent_by_processes_that_nobody_waits_for() -> None:
    """Half a second of a child that its parent never reaps, as the workers of a fork server."""
    assert run_measured([sys.executable, "-c", ORPHANED]).cpu_s > 0.5


def checked(wall_s: float, decoded_bytes: int = 1_000_000_000) -> Statistic:
    return Statistic(
        Run(0, wall_s, 2 * wall_s, 900_000_000),
        {"open": 0.1, "check depth.range": 0.75, "check imu.noise": 0.25, "check flow_rates.composition": 0.5},
        decoded_bytes,
    )


def turns(effort: str, length_s: float, *walls_s: float) -> OfEffort:
    """Turns of one effort; where one is twice as slow as the fastest, so are its start and its decoding."""
    slower = [wall_s / min(walls_s) for wall_s in walls_s]
    readings = [Reading(int(1e9 * length_s), 2.0 * length_s * factor, 2.5 * length_s * factor) for factor in slower]
    return OfEffort(
        effort,
        length_s,
        [
            Turn(checked(2.0 * factor), reading, checked(wall_s))
            for factor, reading, wall_s in zip(slower, readings, walls_s, strict=True)
        ],
    )


def test_a_slower_machine_does_not_change_the_ratio() -> None:
    """Turns that are slower altogether tell the same; of one whose check alone was slowed down, the median is free."""
    slowed = turns("full", 1.0, 5.0, 10.0, 7.0)
    assert slowed.ratio == 1.5
    assert (slowed.start_s, slowed.work_s) == (2.0, 3.0)
    disturbed = OfEffort("full", 1.0, [*slowed.turns[:2], Turn(checked(2.0), slowed.turns[0].reading, checked(50.0))])
    assert disturbed.ratio == 1.5


def test_page_tells_ratios_to_decoding_beside_the_start() -> None:
    study = Study(
        size=(1440, 1080),
        efforts=[
            turns("quick", 1.0, 2.1),
            turns("quick", 4.0, 2.4),
            turns("full", 1.0, 5.0),
            turns("full", 4.0, 14.6),
        ],
        machine=Machine({"copying memory": 1.25, DECODING: 1.6}, 0.4e9, 11e9),
        exhaustive=checked(40.0),
        exhaustive_together=checked(22.0),
        alone=checked(9.0),
        together=checked(5.0),
        on_cluster=OnCluster(checked(8.0), checked(5.5)),
        memories={"1GB": checked(8.0, decoded_bytes=2_000_000_000), "2GB": checked(5.0)},
        selections=[Selection("depth", ("depth", "pose"), checked(3.0, decoded_bytes=200_000_000))],
        fields=10,
        frames=4,
    )
    rows = "".join(page(study)).splitlines()
    assert "| quick | 4 | 2.0 | 0.4 | 0.05 | 0.2 | 0.04 | 4.8 | 900 | 25% |" in rows
    assert "| full | 1 | 2.0 | 3.0 | 1.50 | 1.5 | 1.20 | 10.0 | 900 | 100% |" in rows
    assert "| `full`, time of 4 times the length | 4.20 | 4.4 |" in rows
    assert "| `full`, fastest time / fastest decoding, 4 s | 1.6 | 1.5 |" in rows
    assert "| `exhaustive`, one job's time / two jobs', start included | 1.82 | 1.7 |" in rows
    assert "| `full`, one job's time / two jobs', start included | 1.80 | |" in rows
    assert "| processors that one job keeps busy, as it has OpenCV's threads for itself | 2.00 | |" in rows
    assert "| Dask's time / two jobs', first check of a cluster, whose workers load all libraries | 1.60 | |" in rows
    assert "| Dask's time / two jobs', later checks | 1.10 | 1.15 |" in rows
    assert "| plain decoding of 4 s, MB/s (into new arrays) | 500 (400) | |" in rows
    assert "| copying memory: one process's time / two processes' with half of it each | 1.25 |" in rows
    assert "take 0.62 of the time of one. So of the goal of 1.5 for `full`, 0.88 remain" in "".join(rows)
    assert "| memory written for the first time, GB/s | 0.4 |" in rows
    assert "| 1GB | 900 | 200% | 16.0 | 6.0 |" in rows
    assert "| `depth.range` | 0.75 | 0.75 |" in rows
    assert "| together | 1.50 (12.51) | 1.50 (108.09) |" in rows
    assert "| `full`, ms of one process a flow field, checks of flow | 50.0 | |" in rows
    assert "| `exhaustive`, ms of one process a frame, all others | 250.0 | |" in rows
    assert "| `depth` | 20.0% | 3.0 | depth, pose |" in rows
