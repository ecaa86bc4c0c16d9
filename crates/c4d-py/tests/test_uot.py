"""Optimal transport, compared with POT."""

import math
import time

import numpy as np
import ot
import pytest

from catalyst4d import uot


@pytest.mark.parametrize("reg, reg_m", [(0.1, 1.0), (0.05, (0.5, 2.0))])
def test_plans_equal_those_of_pot(reg, reg_m):
    random = np.random.default_rng(0)
    cost = random.random((60, 45))
    a, b = random.random(60) + 0.1, random.random(45) + 0.1
    a, b = a / a.sum(), b / b.sum()
    ours = uot.solve(a, b, cost, reg=reg, reg_m=reg_m)
    theirs = ot.unbalanced.sinkhorn_unbalanced(
        a, b, cost, reg, reg_m, reg_type="kl", numItermax=100_000, stopThr=1e-14
    )
    assert ours.converged
    np.testing.assert_allclose(ours.plan, theirs, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(ours.row_mass, theirs.sum(1), rtol=1e-6)
    assert abs(ours.transport_cost - (cost * theirs).sum()) < 1e-8
    other = uot.solve(a, b, cost, reg=1.2 * reg, reg_m=reg_m)
    assert abs(other.plan - theirs).max() > 1e-6, "a different weight gives a different plan"


def test_infinite_weights_give_balanced_transport():
    random = np.random.default_rng(1)
    cost = random.random((30, 20))
    ours = uot.solve(cost=cost, reg=0.1, reg_m=math.inf)
    uniform = np.full(30, 1 / 30), np.full(20, 1 / 20)
    theirs = ot.sinkhorn(*uniform, cost, 0.1, numItermax=10_000, stopThr=1e-14)
    np.testing.assert_allclose(ours.plan, theirs, rtol=1e-6, atol=1e-12)


def test_points_are_the_welsch_cost():
    random = np.random.default_rng(2)
    x, y = random.random((80, 3)), random.random((70, 3))
    near = uot.solve(points=(x, y), beta=0.2, cutoff=12)
    squared = ((x[:, None] - y[None]) ** 2).sum(-1)
    dense = uot.solve(cost=1 - np.exp(-squared / (2 * 0.2**2)))
    np.testing.assert_allclose(near.plan, dense.plan, rtol=1e-7)
    assert near.beta == 0.2 and dense.beta is None
    assert (near.best_rows == dense.plan.argmax(0)).all()


def test_parameters_of_ott():
    assert uot.from_tau(0.1, 0.5, 1.0) == {"reg": 0.1, "reg_m": (0.1, math.inf)}


def test_wrong_input_is_an_error():
    for arguments in [
        {},
        {"cost": np.ones((2, 3)), "points": (np.ones((2, 3)), np.ones((2, 3)))},
        {"cost": np.full((2, 3), np.nan)},
        {"cost": np.ones((2, 3)), "a": np.ones(3)},
        {"cost": np.ones((2, 3)), "reg": -1},
        {"cost": np.ones((2, 3)), "reg_type": "l2"},
        {"points": (np.ones((2, 7)), np.ones((2, 7)))},
    ]:
        with pytest.raises(ValueError):
            uot.solve(**arguments)


def test_speed_compared_with_pot(record_property):
    """Two clouds of 5000 points in this process, with all cores for both, to the same accuracy."""
    random = np.random.default_rng(3)
    n, reg = 5000, 0.1
    x = random.random((n, 3))
    y = x + 0.01 * random.standard_normal((n, 3))
    uniform = np.full(n, 1 / n)

    def ours():
        return uot.solve(points=(x, y), reg=reg, tol=1e-6)

    def theirs(beta):
        cost = 1 - np.exp(-ot.dist(x, y) / (2 * beta**2))
        return ot.unbalanced.sinkhorn_unbalanced(
            uniform, uniform, cost, reg, 1.0, reg_type="kl", numItermax=1000, stopThr=1e-6
        )

    def timed(work, *arguments):
        """The result, and the seconds: elapsed, and of all processors."""
        wall, own = time.perf_counter(), time.process_time()
        result = work(*arguments)
        return result, time.perf_counter() - wall, time.process_time() - own

    solved, *our_times = timed(ours)
    plan, *their_times = timed(theirs, solved.beta)
    assert solved.converged
    np.testing.assert_allclose(solved.col_mass, plan.sum(0), rtol=1e-4)
    elapsed, processor = (theirs / ours for theirs, ours in zip(their_times, our_times))
    print(f"\nuot {our_times[0]:.3f} s, POT {their_times[0]:.2f} s: {elapsed:.0f} times faster", end="")
    print(f", {processor:.0f} times less processor time")
    record_property("elapsed", elapsed)
    record_property("processor", processor)
    # 20 or more on an idle machine; the margin is for busy ones
    assert elapsed > 8
