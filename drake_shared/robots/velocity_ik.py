"""Joint speeds that move the tip of an arm as commanded, within its limits: a quadratic program per step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, MathematicalProgram

Floats = NDArray[np.float64]

Inequalities = Callable[[Floats | None], tuple[Floats, Floats]]
"""Returns A (l, n) and b (l,): all rows for None, else at least those that given joint speeds (n,) may
violate, so that the others need not be computed."""

# What a solution may exceed a limit by, in [rad/s] or [m/s]: rounding of the unconstrained minimum.
_TOLERANCE = 1e-9
# Squares of singular values of the Jacobian below this are zero.
_SINGULAR = 1e-9


class VelocityIk:
    """Solves min |J v - t|^2 + p |N (v - u)|^2 + d |v|^2 with bounds on v and inequalities A v >= b.

    J is the Jacobian of the tip, t its twist, u the joint speeds toward a posture, and N the projection onto
    what the tip does not feel: a pull to the posture elsewhere would keep the tip from its target. Where the
    unconstrained minimum is within all limits, it is the solution; otherwise Clarabel (Goulart and Chen 2024)
    solves the program.

    Args:
        size: Number n of joints.
        rows: Largest number m of inequalities.
        posture: p.
        damping: d.
    """

    def __init__(self, size: int, *, rows: int, posture: float = 1e-2, damping: float = 1e-4) -> None:
        self._posture, self._damping = posture, damping * np.eye(size)
        self._identity, self._regularization = np.eye(size), _SINGULAR * np.eye(6)
        self._program = MathematicalProgram()
        v = self._program.NewContinuousVariables(size, "v")
        self._v = v
        self._cost = self._program.AddQuadraticCost(
            np.eye(size), np.zeros(size), v, is_convex=True
        ).evaluator()
        self._bounds = self._program.AddBoundingBoxConstraint(-np.ones(size), np.ones(size), v).evaluator()
        self._rows = self._program.AddLinearConstraint(
            np.zeros((rows, size)), np.full(rows, -1.0), np.full(rows, np.inf), v
        ).evaluator()
        self._no_limit = np.full(rows, np.inf)
        self._solver = ClarabelSolver()

    def solve(
        self,
        jacobian: Floats,
        twist: Floats,
        posture: Floats,
        *,
        lower: Floats,
        upper: Floats,
        inequalities: Inequalities,
    ) -> Floats | None:
        """The solution (n,), in [rad/s], or None if no joint speeds fulfil the constraints.

        Args:
            jacobian: J (6, n).
            twist: t (6,).
            posture: u (n,), in [rad/s].
            lower, upper: Bounds (n,), in [rad/s].
            inequalities: At most m of them.
        """
        felt = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + self._regularization, jacobian)
        pull = self._posture * (self._identity - felt)
        hessian = jacobian.T @ jacobian + pull + self._damping
        gradient = jacobian.T @ twist + pull @ posture
        free: Floats = np.asarray(np.linalg.solve(hessian, gradient), dtype=float)
        within = (free >= lower - _TOLERANCE).all() and (free <= upper + _TOLERANCE).all()
        if within:
            a, b = inequalities(free)
            if (a @ free >= b - _TOLERANCE).all():
                return free
        a, b = inequalities(None)
        self._cost.UpdateCoefficients(2.0 * hessian, -2.0 * gradient, is_convex=True)
        self._bounds.set_bounds(lower, upper)
        matrix, least = np.zeros((len(self._no_limit), len(lower))), np.full(len(self._no_limit), -1.0)
        matrix[: len(a)], least[: len(b)] = a, b
        self._rows.UpdateCoefficients(matrix, least, self._no_limit)
        result = self._solver.Solve(self._program)
        if not result.is_success():
            return None
        solution: Floats = result.GetSolution(self._v)
        return solution
