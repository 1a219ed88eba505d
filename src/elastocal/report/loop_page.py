"""A campaign's page to look into: one HTML file that asks nothing of the network and
draws on canvases of its own."""

from __future__ import annotations

import json
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from elastocal.io.atomic_writes import write_text
from elastocal.loop.schemas import angles_of, worst_measurement
from elastocal.mechanics.kinematics import corners, joint_axes
from elastocal.report import words as say
from elastocal.report.typesetting import load_template

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from elastocal.io.origin import Origin
    from elastocal.mechanics.robot import Robot

# Measurements that a page shows: more are slow to turn on a phone.
_MOST_SHOWN = 4000
# Poses in which the robot can be drawn.
_POSES = 40
# Arrows of the middle length are this share of the width of what they are drawn in.
_ARROW = 0.03


def loop_page(
    facts: Mapping[str, Any], table: Mapping[str, np.ndarray], robot: Robot
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the page of a campaign says, and what it draws.

    `facts`: from `loop_facts.loop_facts`. `table` (N,): columns of the residuals; joint
    angles are the model's, as in a campaign, not the controller's. `robot`: as
    declared. Returns `page`: texts and tables, worded; `data`: JSON-serialisable:
    positions (m), residuals (µm), what they may be drawn against, corners, joints and
    axes of the robot (m).
    """
    count = len(table["x"])
    shown = _spread(count, _MOST_SHOWN)
    if len(shown) < count:
        # The worst is among them whatever the others are.
        shown = np.unique([*_spread(count, _MOST_SHOWN - 1), worst_measurement(table)])
    some = {name: values[shown] for name, values in table.items()}
    position = np.column_stack([some[name] for name in "xyz"])
    off = {
        step: say.MICRO * np.column_stack([some[f"{step}_d{axis}"] for axis in "xyz"])
        for step in ("before", "after")
    }
    angles = angles_of(some, robot.joints)
    # Validation poses of another campaign have numbers of their own.
    pose = np.column_stack([some["held_out"], some["session"], some["pose"]])
    first, of_pose = np.unique(pose, axis=0, return_index=True, return_inverse=True)[1:]
    worst_pose = of_pose.ravel()[worst_measurement(some)]
    in_order = np.argsort(first)
    places = np.unique(
        [*_spread(len(first), _POSES), np.flatnonzero(in_order == worst_pose)[0]]
    )
    places = in_order[places]
    drawn = first[places]
    worst = int(np.flatnonzero(places == worst_pose)[0])
    middle = np.median(np.linalg.norm(off["before"], axis=1)) / say.MICRO
    data = {
        "position": position.round(6).tolist(),
        **{step: values.round(2).tolist() for step, values in off.items()},
        "held_out": some["held_out"].astype(bool).tolist(),
        "against": _against(some, angles, robot),
        "outlines": corners(robot.chain, angles[drawn])
        .swapaxes(0, 1)
        .round(4)
        .tolist(),
        "joints": np.moveaxis(joint_axes(robot.chain, angles[drawn]), 2, 0)
        .round(4)
        .tolist(),
        "worst": worst,
        "poses": [
            f"{some['pose'][row]}" + (", validation" if some["held_out"][row] else "")
            for row in drawn
        ],
        "targets": [
            _targets(some, np.flatnonzero(of_pose.ravel() == place)) for place in places
        ],
        "usual_factor": float(
            _ARROW * np.ptp(position, axis=0).max() / max(middle, 1e-9)
        ),
        "changed": not np.allclose(off["before"], off["after"], rtol=0, atol=0.01),
    }
    page = {**facts, "changed": data["changed"]}
    page["shown"] = [] if len(shown) == count else [len(shown), count]
    return page, data


def write_loop_page(
    path: str | Path,
    page: Mapping[str, Any],
    data: Mapping[str, Any],
    origin: Origin | None = None,
) -> None:
    """Write the page of a campaign; the file appears whole or not at all.

    `path`: the HTML file. `page`, `data`: from `loop_page`. `origin`: named at the foot
    of the page.
    """
    script = (
        resources.files(__package__).joinpath("loop.js").read_text(encoding="utf-8")
    )
    # Texts come from files of other people: they are escaped, and nothing in the data
    # can end the script that holds it.
    numbers = json.dumps(data, allow_nan=False).replace("<", "\\u003c")
    text = load_template("loop.html", say.FILTERS).render(
        page=page, origin=origin, data=Markup(numbers), script=Markup(script)
    )
    write_text(path, text)


def _targets(some: Mapping[str, np.ndarray], rows: np.ndarray) -> list[int]:
    """Of some rows the first of each target."""
    return [
        int(row) for row in rows[np.unique(some["target"][rows], return_index=True)[1]]
    ]


def _spread(count: int, most: int) -> np.ndarray:
    """Places of at most so many of `count` things, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def _against(
    some: Mapping[str, np.ndarray], angles: np.ndarray, robot: Robot
) -> list[dict[str, Any]]:
    """Quantities that a residual may be drawn against, those that vary."""
    force = np.linalg.norm(
        np.column_stack([some[f"f{axis}"] for axis in "xyz"]), axis=1
    )
    found = []
    for joint, prismatic in enumerate(robot.chain.prismatic):
        name, unit = (
            (f"joint {joint + 1}", "m")
            if prismatic
            else (f"angle of joint {joint + 1}", "°")
        )
        found.append(
            (
                name,
                unit,
                angles[:, joint] if prismatic else np.degrees(angles[:, joint]),
            )
        )
    found += [
        ("force", "N", force),
        *((f"force along {axis}", "N", some[f"f{axis}"]) for axis in "xyz"),
    ]
    found += [(f"position {axis}", "m", some[axis]) for axis in "xyz"]
    found += [
        ("order of measurement", "row", some["row"]),
        ("time", "s", some.get("time_s", np.zeros(0))),
    ]
    return [
        {
            "name": name,
            "unit": unit,
            "values": [float(f"{value:.5g}") for value in values],
        }
        for name, unit, values in found
        if len(values) and np.isfinite(values).all() and np.ptp(values) > 0
    ]
