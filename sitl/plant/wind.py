"""Wind: a mean given by the caller, and gusts as a first-order Gauss-Markov process on each axis.

The random numbers are an argument, as everywhere in the simulator, so that a flight is reproducible.
"""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, axpy, scale
from sitl.plant.rotors import decay


@kernel
def gust(previous: Vec3, deviation: float, correlation_time: float, h: float, normals: Vec3) -> Vec3:
    """The gust (world, m/s) h seconds after `previous`, to be added to the mean wind.

    `normals` are three independent standard normal numbers. The discretisation is exact: in the steady state
    each axis has the standard deviation `deviation` (m/s) and the correlation exp(-t/correlation_time) (s),
    whatever the step.
    """
    kept = decay(h / correlation_time)
    return axpy(kept, previous, scale(deviation * sqrt(1.0 - kept * kept), normals))
