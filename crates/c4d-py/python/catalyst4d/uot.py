"""Entropic unbalanced optimal transport.

Minimises over plans P ≥ 0, for a cost D [n,m] and marginals a [n], b [m]::

    <D, P> + reg KL(P | a bᵀ) + reg_a KL(P 1 | a) + reg_b KL(Pᵀ 1 | b)

with KL(x | y) = Σ x ln(x/y) − x + y. An infinite ``reg_m`` enforces that marginal exactly.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from . import _native
from ._arrays import as_numpy


class Transport:
    """A solved problem. See :func:`solve`."""

    def __init__(self, native: _native.Transport) -> None:
        self._native = native
        self._summary = native.summary()

    @property
    def f(self) -> np.ndarray:
        """Row potentials, cost units, [n]."""
        return self._summary["f"]

    @property
    def g(self) -> np.ndarray:
        """Column potentials, cost units, [m]."""
        return self._summary["g"]

    @property
    def row_mass(self) -> np.ndarray:
        """P 1, [n]."""
        return self._summary["row_mass"]

    @property
    def col_mass(self) -> np.ndarray:
        """Pᵀ 1, [m]."""
        return self._summary["col_mass"]

    @property
    def total_mass(self) -> float:
        """Sum of the plan."""
        return self._summary["total_mass"]

    @property
    def objective(self) -> float:
        """Value of the objective, cost units."""
        return self._summary["objective"]

    @property
    def converged(self) -> bool:
        """Whether the potentials moved by less than ``tol · reg`` in the last sweep."""
        return self._summary["converged"]

    @property
    def sweeps(self) -> int:
        """Number of sweeps; one updates both sides."""
        return self._summary["sweeps"]

    @property
    def residuals(self) -> np.ndarray:
        """Largest change of the potentials by a plain step, divided by ``reg``, [sweeps]."""
        return self._summary["residuals"]

    @property
    def beta(self) -> float | None:
        """Width of the Welsch cost, in the unit of the points; None for a cost matrix."""
        return self._summary["beta"]

    @cached_property
    def plan(self) -> np.ndarray:
        """The plan, [n,m], computed on first use."""
        return self._native.plan()

    @cached_property
    def transport_cost(self) -> float:
        """<D, P>, cost units."""
        return self._native.transport_cost()

    @cached_property
    def best_rows(self) -> np.ndarray:
        """For each column the row with the largest share of its mass, −1 for none, [m]."""
        return self._native.best_rows()


def solve(
    a: object = None,
    b: object = None,
    cost: object = None,
    *,
    points: tuple[object, object] | None = None,
    reg: float = 0.1,
    reg_m: float | tuple[float, float] = 1.0,
    reg_type: str = "kl",
    tol: float = 1e-9,
    max_sweeps: int = 20_000,
    acceleration: str = "auto",
    gamma: float = 0.05,
    beta: float | None = None,
    cutoff: float = 6.0,
) -> Transport:
    """Solves an unbalanced transport problem.

    Args:
        a: Marginal of the rows, [n]; uniform if None.
        b: Marginal of the columns, [m]; uniform if None.
        cost: Any finite cost matrix, [n,m].
        points: Two clouds, [n,d] and [m,d] with d from 1 to 6, instead of ``cost``: the bounded
        Welsch cost 1 − exp(−r²/(2β²)), evaluated without an array of size n·m.
        reg: λ0, weight of the entropy, cost units.
        reg_m: λ1 and λ2, weights of the marginals, cost units, or one number for both.
            ``math.inf`` enforces a marginal exactly.
        reg_type: ``kl``: KL to a bᵀ. ``entropy``: Σ P ln P − P. ``plogp``: Σ P ln P.
        tol: Stops when all potentials change by less than ``tol · reg``.
        max_sweeps: Maximum number of sweeps; then stops with ``converged`` False.
        acceleration: ``auto``, ``plain``, ``overrelaxed`` or ``anderson``; the plan is the same.
        gamma: β as a multiple of the median distance between the clouds.
        beta: β itself, in the unit of the points.
        cutoff: Pairs farther than ``cutoff · β`` cost exactly 1.

    Raises:
        ValueError: For inconsistent shapes and values out of range.
    """
    row_weight, col_weight = (reg_m, reg_m) if isinstance(reg_m, (int, float)) else reg_m
    double = lambda value: None if value is None else as_numpy(value, np.float64)  # noqa: E731
    clouds = None
    if points is not None:
        clouds = (as_numpy(points[0], np.float64), as_numpy(points[1], np.float64))
    return Transport(
        _native.solve_transport(
            double(a),
            double(b),
            double(cost),
            clouds,
            float(reg),
            float(row_weight),
            float(col_weight),
            reg_type,
            float(tol),
            max_sweeps,
            acceleration,
            float(gamma),
            beta,
            float(cutoff),
        )
    )


def from_tau(epsilon: float, tau_a: float, tau_b: float) -> dict[str, object]:
    """Converts OTT's parameters to those of :func:`solve`: τ = λ/(λ + ε).

    ``solve(..., **from_tau(0.1, 0.9, 1.0))``
    """
    weight = lambda tau: math.inf if tau == 1.0 else epsilon * tau / (1.0 - tau)  # noqa: E731
    return {"reg": epsilon, "reg_m": (weight(tau_a), weight(tau_b))}
