"""Files of other ground stations: missions (.plan, .waypoints) and parameters (.params)."""
