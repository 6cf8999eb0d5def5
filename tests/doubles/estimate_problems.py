"""What is wrong with an estimate, in the words for the operator."""

from __future__ import annotations

from autopilot.estimation.filter import load_problem, problem_texts, vehicle_problem
from autopilot.estimation.records import EstimatorState


def estimate_problems(state: EstimatorState, max_age_s: float, carries_load: bool = True) -> tuple[str, ...]:
    """As the flight software tells them, in a flight with or without a load."""
    load = load_problem(state, max_age_s) if carries_load else 0
    return problem_texts(state, vehicle_problem(state, max_age_s), load)
