"""Two faults in one file."""

import h5py

from tests.benchmarks.foreign_faults.kind import Plan, Plant


def both(first: Plant, second: Plant, size: float = 0.0) -> Plant:
    """Plant the first with the size of the plan, and then the second, with a size of its own."""

    def plant(file: h5py.File, plan: Plan) -> None:
        first(file, plan)
        second(file, Plan(size, plan.begin, plan.end, plan.random, plan.donor))

    return plant
