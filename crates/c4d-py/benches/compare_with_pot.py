"""Unbalanced transport compared with POT: one process, all cores for both, equal accuracy.

.ci/python creates the environment: target/python/new/bin/python crates/c4d-py/benches/compare_with_pot.py
"""

import time

import numpy as np
import ot
from catalyst4d import uot

REG, REG_M, TOLERANCE = 0.1, 1.0, 1e-9
REPEATS = 3


def timed(work):
    """The result, the elapsed time and the CPU time, seconds."""
    wall, own = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - own


def table(n):
    random = np.random.default_rng(3)
    x = random.random((n, 3))
    y = x + 0.01 * random.standard_normal((n, 3))
    uniform = np.full(n, 1 / n)

    def ours():
        return uot.solve(points=(x, y), reg=REG, tol=TOLERANCE)

    runs = sorted((timed(ours) for _ in range(REPEATS)), key=lambda run: run[1])
    solved, wall, own = runs[REPEATS // 2]
    print(f"| {n} | catalyst4d | {wall:.3f} ({runs[0][1]:.3f}–{runs[-1][1]:.3f}) | {own:.2f} | – |")

    def theirs(method):
        cost = 1 - np.exp(-ot.dist(x, y) / (2 * solved.beta**2))
        return ot.unbalanced.sinkhorn_unbalanced(
            uniform, uniform, cost, REG, REG_M, reg_type="kl", method=method,
            numItermax=20_000, stopThr=TOLERANCE,
        )

    for method in ("sinkhorn", "sinkhorn_translation_invariant"):
        plan, slow, processor = timed(lambda: theirs(method))
        difference = np.abs(plan.sum(0) / solved.col_mass - 1).max()
        assert difference < 1e-8, f"{method}: column masses differ by {difference}"
        print(f"| {n} | POT, `{method}` | {slow:.2f} | {processor:.2f} | {slow / wall:.0f} |")


print("| n | solver | s | s, all processors | elapsed, relative |\n|---|---|---|---|---|")
for size in (5_000, 10_000):
    table(size)
