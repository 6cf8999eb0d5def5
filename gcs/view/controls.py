"""The sliders of the page: parameters that may be changed while the vehicle flies."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Slider:
    """A parameter, and how a page shows it."""

    name: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    default: float | None = None  # None: the value that the vehicle reports; the ends are shares of it

    def record(self) -> dict[str, Any]:
        """For the page."""
        return asdict(self)


SLIDERS = (
    Slider("SIM_WIND_N", "Wind to the north", "m/s", -12.0, 12.0, 0.5, 0.0),
    Slider("SIM_WIND_E", "Wind to the east", "m/s", -12.0, 12.0, 0.5, 0.0),
    Slider("SIM_GUST_STD", "Random gusts", "m/s", 0.0, 4.0, 0.1, 0.0),
    Slider("SIM_LOAD_MASS", "True mass of the load", "kg", 0.02, 0.25, 0.005),
    Slider("SIM_ACT_DELAY_MS", "Delay of the rotors", "ms", 0.0, 60.0, 2.0, 0.0),
    Slider("SIM_NOISE_SCALE", "Noise of the sensors", "×", 0.0, 10.0, 0.5, 1.0),
    Slider("SIM_LOSS_PCT", "Losses of the ground link", "%", 0.0, 60.0, 5.0, 0.0),
)
SLIDER_NAMES = {slider.name for slider in SLIDERS}
# further parameters that the page shows or draws
SHOWN_PARAMETERS = ("VEH_ARM_LEN", "VEH_CABLE_LEN", "SIM_ENGINE_FAIL", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST")
