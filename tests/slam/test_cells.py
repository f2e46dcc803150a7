import numpy as np

from slam.cells import CellGrid, Stretches


def test_each_cell_takes_one_point_whatever_the_order():
    rng = np.random.default_rng(0)
    grid, taken = CellGrid(0.1), set()
    for scale in (0.5, 3.0, 30.0):
        places = rng.normal(0.0, scale, (400, 2))
        fresh = grid.take(places)
        cells = [tuple(cell) for cell in np.floor(places / 0.1).astype(int).tolist()]
        expected = [k for k, c in enumerate(cells) if c not in taken and cells.index(c) == k]
        assert fresh.tolist() == expected
        taken |= set(cells)
    assert len(grid.take(places)) == 0
    assert len(grid.take(np.empty((0, 2)))) == 0


def test_a_stretch_knows_its_holes():
    wall = Stretches()
    assert wall.gap(np.array([0.0])) == np.inf
    wall.add(np.linspace(0.0, 2.0, 50))
    wall.add(np.linspace(-9.0, -7.0, 50))
    assert wall.gap(np.array([1.0, 30.0])) == 0.0
    assert wall.gap(np.array([-1.4, -1.2])) == 1.0
    assert wall.gap(np.array([4.1])) == 1.75
