"""What reads the targets, and the noise that a plan assumes of it.

Standard deviations of one reading are half of what the maker permits as the largest error, which a tracker's manual calls
typical [1]; the angles of its probe are from [2], those of cameras from [3].

[1] Hexagon, Leica Absolute Tracker AT500 User Manual, section 2.8: transverse error at most 15 um + 6 um/m, typical results
    half of that.
[2] Hexagon, data sheet of the Leica T-Mac: rotation angles to 0.01 deg, which is 18 um at 100 mm.
[3] Krumpek, O., Kroeger, O. and Mohr, S., Reproducible Optical Tracking Precision: Evaluating a Static, Near-Parallel Support
    Structure for OptiTrack PrimeX22 Cameras, arXiv:2502.21189, 2025: 0.12 mm across the line of sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Sensor:
    """Standard deviations of one component of a reading; no orientation where it reads positions only.

    `words`: which instrument it stands for, and where the values are from. `measured`: what it reads, "position" or "pose", the
    usual first.
    """

    words: str
    measured: tuple[str, ...]
    position_m: float
    orientation_rad: float | None


# Half of 15 um + 6 um/m at 7.5 m.
_TRACKER_M = 30e-6
# Across the line of sight; a pose is that of markers 0.2 m apart.
_CAMERA_M, _MARKERS_M = 0.12e-3, 0.2
SENSORS = {
    "tracker": Sensor(
        "laser tracker and reflector at 7.5 m, half of MPE 15 µm + 6 µm/m (Leica AT500)", ("position",), _TRACKER_M, None
    ),
    "t-mac": Sensor(
        "laser tracker and 6DoF probe, half of MPE 15 µm + 6 µm/m at 7.5 m and of 0.01° (Leica T-Mac)",
        ("pose", "position"),
        _TRACKER_M,
        math.radians(0.01) / 2,
    ),
    "camera": Sensor(
        "optical tracking, 0.12 mm across the line of sight (OptiTrack, arXiv:2502.21189), poses of markers 0.2 m apart",
        ("position", "pose"),
        _CAMERA_M,
        math.sqrt(2.0) * _CAMERA_M / _MARKERS_M,
    ),
}
