"""Two faults in one file."""

import h5py

from tests.benchmarks.foreign_faults.kind import Plan, Plant, Range


def both(first: Plant, second: Plant, size: Range | None = None) -> Plant:
    """Plant the first with the size of the plan, and then the second, with a size drawn from a range of its own."""

    def plant(file: h5py.File, plan: Plan) -> None:
        own = 0.0 if size is None else size.draw(plan.random)
        first(file, plan)
        second(file, Plan(own, plan.begin, plan.end, plan.random, plan.donor))

    return plant
