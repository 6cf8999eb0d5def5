"""metrics.toml: the keys that programs rely on, how values are shown, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from gcs.analysis.definitions import GROUPS, HEADLINE, METRICS, Metric, MetricFile
from tests.doubles.recorded_flights import STABLE_KEYS


def test_keys_that_programs_rely_on_are_there():
    assert STABLE_KEYS - {"report_dir"} <= METRICS.keys()  # the report adds its directory


def test_every_metric_is_in_one_group_in_the_order_of_the_record():
    assert [metric.name for _, metrics in GROUPS for metric in metrics] == list(METRICS)
    assert HEADLINE.keys() <= METRICS.keys()


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("load_error_max_m", 0.01234, "12.3 mm"),
        ("load_error_max_m", 1.234, "1.23 m"),
        ("load_error_max_m", None, "–"),
        ("saturated_fraction", 0.0512, "5.1 %"),
        ("tilt_max_deg", 12.34, "12.3°"),
        ("real_time_factor", 7.77, "7.8 ×"),
        ("gap_max_s", 0.0081, "8.1 ms"),
        ("psi_R_max", 0.01236, "0.0124"),
        ("slack_events", 3, "3"),
        ("outcome", "completed", "completed"),
    ],
)
def test_values_as_people_read_them(key, value, text):
    assert METRICS[key].formatted({key: value}) == text


@pytest.mark.parametrize(
    ("key", "value", "in_metres", "text"),
    [
        ("load_error_max_m", 0.0030123, False, "3.01 mm"),
        ("load_error_max_m", 0.0030123, True, "0.00301 m"),
        ("load_error_max_m", 1.14749, True, "1.147 m"),
        ("load_error_max_m", 0.1334, False, "133.4 mm"),
        ("load_error_max_m", None, True, "–"),
        ("psi_R_max", 8.0993e-05, False, "0.0000810"),
        ("psi_R_max", 1e-12, False, "1.00e-12"),
        ("psi_R_max", 0.0, False, "0.0000"),
        ("saturated_fraction", 7.1429e-05, False, "0.00714 %"),
        ("tilt_max_deg", 0.1234, True, "0.123°"),
        ("slack_events", 3, False, "3"),
        ("outcome", "completed", False, "completed"),
    ],
)
def test_values_beside_those_of_other_flights_have_three_digits(key, value, in_metres, text):
    assert METRICS[key].formatted_alike({key: value}, in_metres) == text


def test_a_scale_belongs_to_another_unit():
    for metric in METRICS.values():
        if metric.scale != 1.0:
            assert (metric.unit, metric.shown, metric.scale) in (
                ("m", "mm", 1000.0),
                ("s", "ms", 1000.0),
                ("0 ... 1", "%", 100.0),
            )


def document(**metric: Any) -> dict[str, Any]:
    table = {"group": "g", "label": "L", "text": "t", **metric}
    return {"groups": {"g": {"title": "G"}}, "headline": {"a_m": "a"}, "metrics": {"a_m": table}}


def test_a_file_is_read():
    read = MetricFile.model_validate(document(unit="m", decimals=2))
    assert read.metrics == {"a_m": Metric(name="a_m", group="g", label="L", text="t", unit="m", decimals=2)}


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (document(group="h"), "a_m.group = h; must be one of g"),
        (document(better="fewer"), "metrics.a_m.better"),
        (document(units="m"), "metrics.a_m.units"),
        (document(scale=0.0), "metrics.a_m.scale"),
        ({**document(), "headline": {"b": "b"}}, "headline.b: no such metric"),
    ],
)
def test_what_is_wrong_is_refused(wrong, text):
    with pytest.raises(ValidationError) as caught:
        MetricFile.model_validate(wrong)
    assert text in str(caught.value)
