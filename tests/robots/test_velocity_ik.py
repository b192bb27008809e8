"""The quadratic program of an arm's joint speeds, against a second solver."""

import numpy as np
from hypothesis import assume, given, settings, strategies as st
from scipy.optimize import minimize

from drake_shared.robots.velocity_ik import VelocityIk

N, ROWS = 7, 6
IK = VelocityIk(N, rows=ROWS)


def program(seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    width = random.uniform(0.02, 1.0)
    return {
        "jacobian": random.normal(size=(6, N)),
        "twist": random.normal(size=6),
        "posture": random.normal(size=N),
        "lower": -width * random.uniform(0.1, 1.0, N),
        "upper": width * random.uniform(0.1, 1.0, N),
        "a": random.normal(size=(ROWS, N)),
        "b": -random.uniform(0.0, 0.3, ROWS),
    }


def solve(given: dict[str, np.ndarray]) -> np.ndarray | None:
    """The solution, by rows that are all known, or only those that the given speeds violate."""
    a, b = given["a"], given["b"]

    def violated(speeds: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        which = slice(None) if speeds is None else a @ speeds < b
        return a[which], b[which]

    rest = {name: value for name, value in given.items() if name not in ("a", "b")}
    one, other = (IK.solve(**rest, inequalities=rows) for rows in (violated, lambda _: (a, b)))
    np.testing.assert_array_equal(one, other)
    return one


def cost(given: dict[str, np.ndarray], speeds: np.ndarray) -> float:
    unfelt = np.linalg.svd(given["jacobian"])[2][6:]
    error = given["jacobian"] @ speeds - given["twist"]
    pull = unfelt @ (speeds - given["posture"])
    return float(error @ error + 1e-2 * pull @ pull + 1e-4 * speeds @ speeds)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 100_000))
def test_the_solution_is_that_of_a_second_solver(seed):
    given = program(seed)
    found = solve(given)
    second = minimize(
        lambda v: cost(given, v),
        np.zeros(N),
        method="SLSQP",
        bounds=list(zip(given["lower"], given["upper"], strict=True)),
        constraints={"type": "ineq", "fun": lambda v: given["a"] @ v - given["b"]},
        options={"ftol": 1e-12, "maxiter": 500},
    )
    # It stops now and then where its line search cannot improve by rounding.
    assume(second.success)
    assert found is not None
    assert (found >= given["lower"] - 1e-7).all()
    assert (found <= given["upper"] + 1e-7).all()
    assert (given["a"] @ found >= given["b"] - 1e-7).all()
    assert cost(given, found) <= second.fun + 1e-6


def test_far_from_all_limits_the_solution_is_the_unconstrained_minimum():
    given = program(0) | {"lower": np.full(N, -1e3), "upper": np.full(N, 1e3), "b": np.full(ROWS, -1e3)}
    found = solve(given)
    slopes = [(cost(given, found + step) - cost(given, found - step)) / 2e-6 for step in 1e-6 * np.eye(N)]
    np.testing.assert_allclose(slopes, 0.0, atol=1e-6)


def test_the_posture_does_not_move_what_the_tip_feels():
    given = program(1) | {"lower": np.full(N, -1e3), "upper": np.full(N, 1e3), "b": np.full(ROWS, -1e3)}
    one, other = (solve(given | {"posture": posture}) for posture in (np.zeros(N), np.ones(N)))
    # Up to the regularization, which keeps the projection finite where the arm is singular.
    np.testing.assert_allclose(given["jacobian"] @ one, given["jacobian"] @ other, atol=1e-6)
    assert np.linalg.norm(one - other) > 0.1


def test_contradicting_constraints_have_no_solution():
    row = np.ones((1, N))
    given = program(2) | {"a": np.vstack([row, -row]), "b": np.array([0.1, 0.1])}
    assert solve(given) is None
