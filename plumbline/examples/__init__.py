"""Examples of custom laws, an estimator and a planner: docs/laws.md, estimators.md and planners.md."""
