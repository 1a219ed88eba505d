"""What physics allows in a column of measurements, or of wanted poses: from, to, and why."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bound:
    """Least and largest value of a column, in its unit, and the reason in words that follow "x to y"."""

    least: float
    largest: float
    reason: str

    @property
    def allowed(self) -> str:
        """What an error says."""
        return f"{self.least:g} to {self.largest:g} {self.reason}"


# A turn and a half, of a rotation vector; nor does a joint of a serial arm report more, unless its limits say so.
FARTHEST_RAD = 3.0 * np.pi
# Generous: whatever lies beyond is in another unit, or no reading of an instrument beside a robot.
_FORCE = Bound(-1e6, 1e6, "N, the weight of a hundred tonnes")
_MOMENT = Bound(-1e7, 1e7, "N m, a hundred tonnes on a lever of ten metres")
_PLACE = Bound(-2e7, 2e7, "m, half the circumference of the Earth")
BOUNDS: Mapping[str, Bound] = {
    **dict.fromkeys(("fx", "fy", "fz"), _FORCE),
    **dict.fromkeys(("mx", "my", "mz"), _MOMENT),
    **dict.fromkeys("xyz", _PLACE),
    "time_s": Bound(-1e11, 1e11, "s, three thousand years either way: not milliseconds of a calendar"),
    "temperature_c": Bound(-200.0, 200.0, "°C, in which arms work, not kelvin"),
    "u95_m": Bound(1e-8, 0.1, "m, more than 0: a sixtieth of a laser's wavelength at least, at most what a robot is off by"),
}


def find_beyond(name: str, values: np.ndarray) -> int | None:
    """First of the values of a column (N,) that physics does not allow; None where it allows all of them."""
    bound = BOUNDS.get(name)
    if bound is None:
        return None
    # Not a number is no more than anything either.
    wrong = ~((values >= bound.least) & (values <= bound.largest))
    return int(np.argmax(wrong)) if wrong.any() else None
