"""A .plan as MAVSDK reads it: `python mavsdk_plan.py PORT PLAN`; its items and the vehicle's as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw

LONG_S = 60.0
FIELDS = ("frame", "command", "param1", "param2", "param3", "x", "y", "z")


def main(port: str, plan: Path) -> None:
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        mission = MissionRaw(mavsdk.first_autopilot(LONG_S))

        def told(items: Any) -> list[list[float]]:
            return [[getattr(item, field) for field in FIELDS] for item in items]

        read = mission.import_qgroundcontrol_mission_from_string(plan.read_text()).mission_items
        print(json.dumps({"plan": told(read), "vehicle": told(mission.download_mission())}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
