"""A robot as it is seen from the side and a little from above, with its shadow on the plane of its base."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

_AZIMUTH, _ELEVATION = np.radians(-60.0), np.radians(20.0)
_ARM, _EDGE, _SHADOW = "#8d9aa5", "#55636e", "#e3e3e3"


def project_view(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) in base axes, m, in the plane of the picture, (..., 2): to the right and up."""
    x, y, z = np.moveaxis(points, -1, 0)
    away = x * np.cos(_AZIMUTH) + y * np.sin(_AZIMUTH)
    right = y * np.cos(_AZIMUTH) - x * np.sin(_AZIMUTH)
    return np.stack([right, z * np.cos(_ELEVATION) - away * np.sin(_ELEVATION)], axis=-1)


def draw_arm(axis: Axes, links: np.ndarray, width: float) -> None:
    """Draw a robot as thick lines along its chain, and its shadow.

    `links` (N, 3): points along the moving links, base axes, m. `width`: of the lines, in points.
    """
    links = np.concatenate([np.zeros((1, 3)), links[:1] * [0.0, 0.0, 1.0], links])
    round_ends: dict[str, Any] = {"solid_capstyle": "round", "solid_joinstyle": "round"}
    axis.plot(*project_view(links * [1.0, 1.0, 0.0]).T, color=_SHADOW, lw=0.8 * width, zorder=0, **round_ends)
    for color, share in ((_EDGE, 1.0), (_ARM, 0.72)):
        axis.plot(*project_view(links).T, color=color, lw=share * width, zorder=1, **round_ends)
