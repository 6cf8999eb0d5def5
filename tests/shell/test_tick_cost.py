"""What a tick costs."""

from __future__ import annotations

from autopilot.shell.tick_cost import TickCost


def test_the_whole_run_in_a_line() -> None:
    cost = TickCost()
    assert cost.summary() == ""
    for cost_us in [95] * 98 + [450, 25_000]:
        cost.count(cost_us, 4000, 4000)
    said = "processor time of a tick: p50 100 p99 460 max 25000 us; 1 of 100 took longer than a tick"
    assert cost.summary() == said


def test_only_work_between_two_ticks_counts() -> None:
    cost = TickCost()
    cost.tick(0)
    cost.tick(0)  # the length of a tick is not known yet
    cost.pause()
    cost.tick(4000)
    assert cost.summary() == ""
    sum(range(200_000))
    cost.tick(1)  # as if ticks lasted a microsecond
    assert cost.summary().endswith("1 of 1 took longer than a tick")


def test_a_tick_that_the_machine_delays_is_told_at_any_speed() -> None:
    for usual_us in (400, 4000, 40_000):
        cost = TickCost()
        for _ in range(1000):
            cost.count(100, usual_us, 4000)
        assert "delayed" not in cost.summary()
        cost.count(100, 50 * usual_us, 4000)
        cost.count(5000, 50 * usual_us, 4000)  # its own work
        cost.count(100, 3 * usual_us, 4000)
        assert cost.summary().endswith("; the machine delayed 2 by a tick or longer")
