"""Parts of the lattice of a field."""

import numpy as np

from fedora_qa.views.pixel_lattice import FlowLattice, union_of


def test_a_region_and_what_lies_beside_it_are_the_lattice() -> None:
    """Each depth lies in a region or beside it, which is half-open."""
    columns, rows = np.arange(1.0, 13.0, 2.0)[None, :], np.arange(0.0, 10.0, 2.0)[:, None]
    depths_m = rows * 100 + columns
    lattice = FlowLattice(columns, rows, depths_m, np.zeros((*depths_m.shape, 2)))
    within, beside = lattice.within((3, 2, 7, 6)).depths_m, lattice.beside((3, 2, 7, 6)).depths_m
    np.testing.assert_array_equal(within[np.isfinite(within)], [203, 205, 403, 405])
    assert np.all(np.isfinite(within) ^ np.isfinite(beside))
    np.testing.assert_array_equal(np.where(np.isfinite(within), within, beside), depths_m)


def test_the_union_holds_all_rectangles() -> None:
    """Its edges are the outermost ones; nothing has no rectangle."""
    assert union_of([(48, 36, 133, 101), (45, 37, 134, 102)]) == (45, 36, 134, 102)
    assert union_of([]) is None
