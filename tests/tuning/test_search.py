import numpy as np
import pytest

from relnav_sim.tuning.search import search


def run(function, start, budget, together=1):
    """Return the points tried with their values, in rounds."""
    rounds = []
    asking = search(start, budget, together)
    points = next(asking)
    while True:
        rounds.append([(point, function(np.array(point))) for point in points])
        try:
            points = asking.send([value for _, value in rounds[-1]])
        except StopIteration:
            return rounds


def best(rounds):
    return min((pair for tried in rounds for pair in tried), key=lambda pair: pair[1])


@pytest.mark.parametrize("minimum", [0.0, 0.03, 0.41, 0.77, 1.0])
def test_one_axis_is_found_to_a_part_in_two_hundred(minimum):
    def cusp(u):
        return abs(u[0] - minimum)

    for bowl in (cusp, lambda u: cusp(u) ** 2, lambda u: -np.exp(-cusp(u))):
        assert abs(best(run(bowl, (0.5,), 25))[0][0] - minimum) < 5e-3


@pytest.mark.parametrize("tilt", [0.0, 0.8, -0.8])
def test_two_axes_with_a_tilted_valley(tilt):
    target = np.array([0.62, 0.35])

    def valley(u):
        a, b = u - target
        return 3 * a * a + b * b + 2 * tilt * np.sqrt(3) * a * b

    rounds = run(valley, (0.5, 0.5), 40)
    assert best(rounds)[1] < 1e-3
    assert best(run(valley, (0.5, 0.5), 25))[1] < 2e-3


def test_three_axes():
    target = np.array([0.3, 0.6, 0.45])
    assert best(run(lambda u: float(np.square(u - target).sum()), (0.5, 0.5, 0.5), 45))[1] < 5e-3


def test_failures_are_walked_around():
    wall = lambda u: np.inf if u[0] < 0.55 else u[0]  # noqa: E731  shorter than a function of its own
    point, value = best(run(wall, (0.2,), 25))
    assert 0.55 <= value < 0.57
    assert point == (value,)


def test_all_failing_ends_with_the_budget():
    assert sum(map(len, run(lambda u: np.inf, (0.5, 0.5), 25))) == 25


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("budget", [5, 17, 25, 60])
def test_budget_start_and_no_point_twice(d, budget):
    start = (0.37,) * d
    rounds = run(lambda u: float(np.sin(9 * u).sum()), start, budget)
    points = [point for tried in rounds for point, _ in tried]
    assert points[0] == start
    assert len(points) == len(set(points)) <= budget
    assert len(points) == budget or (d == 1 and budget > 25)  # there the smallest reach ends it
    assert all(0 <= u <= 1 for point in points for u in point)


def test_a_small_budget_still_reaches_both_ends():
    (first, *_) = run(lambda u: float(u[0]), (0.37,), 5)
    assert [point for point, _ in first] == [(0.37,), (0.0,), (0.3333,), (0.6667,), (1.0,)]


def test_the_same_again():
    def bowl(u):
        return float(np.square(u - 0.3).sum())

    assert run(bowl, (0.5, 0.5), 30) == run(bowl, (0.5, 0.5), 30)


def test_axes_that_are_alike_move_as_one_at_first():
    """Three densities five decades too low: each alone shows next to nothing, as the other two spoil it."""

    def worst(u):
        return float(np.abs(u - [0.62, 0.6, 0.64]).max())

    start = (0.2, 0.2, 0.25)
    rounds = run(worst, start, 25, together=3)
    tried = [point for points in rounds for point, _ in points]
    assert len(tried) == 25 and tried[0] == start
    assert best(rounds)[1] < 0.05 < best(run(worst, start, 25))[1]
    np.testing.assert_allclose(np.subtract(*np.array(tried[:6])[:, [1, 0]].T), 0.0, atol=1e-4)
