"""What is really flying; it may differ from what the autopilot believes."""

from sitl.vehicles.files import TruthFileError, load_truth, shipped

__all__ = ["TruthFileError", "load_truth", "shipped"]
