"""The frames of Denavit-Hartenberg rows on a robot, as a picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from elastocal.figures.style import PALETTE, WIDTH_MM, styled

_AXES = ("x", "y", "z")
_COLORS = (PALETTE[1], PALETTE[2], PALETTE[0])
# Of an axis, over the reach of the robot.
_LENGTH_SHARE = 0.12


@styled
def dh_frames_picture(frames: np.ndarray, robot: str, names: Sequence[str]) -> Figure:
    """Frames where the controller reports zero, joined by a line from the base to the end effector.

    `frames` (F, 4, 4): from `exchange.dh_writing.dh_frames`, base axes. `robot`: name. `names` (F,) of str: what stands at each
    frame.
    """
    figure = Figure(figsize=(WIDTH_MM / 25.4, 120 / 25.4), layout="constrained")
    axis = figure.add_subplot(projection="3d")
    origins = np.concatenate([np.zeros((1, 3)), frames[:, :3, 3]])
    axis.plot(*origins.T, color="#9a9a9a", lw=2.5, zorder=1)
    span = np.ptp(origins, axis=0).max()
    length = _LENGTH_SHARE * span
    for k, (name, color) in enumerate(zip(_AXES, _COLORS, strict=True)):
        for number, frame in enumerate(frames):
            ends = np.stack([frame[:3, 3], frame[:3, 3] + length * frame[:3, k]])
            axis.plot(*ends.T, color=color, lw=1.6, label=f"{name} axis" if number == 0 else None)
    # Names of frames that lie within an axis of each other stand together.
    origins_of_names: list[tuple[np.ndarray, list[str]]] = []
    for frame, name in zip(frames, names, strict=True):
        near = [others for origin, others in origins_of_names if np.linalg.norm(origin - frame[:3, 3]) < length]
        if near:
            near[0].append(name)
        else:
            origins_of_names.append((frame[:3, 3], [name]))
    for origin, those in origins_of_names:
        axis.text(origin[0], origin[1], origin[2] + 0.6 * length, ", ".join(those), fontsize=7.5, ha="center")
    middle = 0.5 * (origins.min(axis=0) + origins.max(axis=0))
    half = 0.5 * span + length
    for name, centre in zip(_AXES, middle, strict=True):
        along: dict[str, Any] = {f"{name}lim": (centre - half, centre + half), f"{name}label": f"{name} of the base (m)"}
        axis.set(**along)
    axis.set_title(f"{robot}: numbered frames where the controller reports zero; joint k turns about z of frame k - 1")
    axis.set_box_aspect((1, 1, 1), zoom=1.1)
    axis.locator_params(nbins=5)
    axis.view_init(elev=18, azim=-62)
    figure.legend(loc="outside lower center", ncols=3)
    return figure
