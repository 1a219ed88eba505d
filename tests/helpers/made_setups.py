"""Surveys of a Panda without a tracker, one for each kind of measurement."""

import numpy as np
from analysed_robots import analysed

from elastocal.application.planning.reaching import SetUp, orient_mount
from elastocal.application.planning.survey import Survey
from elastocal.campaigns.campaign import Target
from elastocal.measuring.catalogue import list_kinds

UP = (0.0, 0.0, 1.0)
PLACES = {
    "point": {"left": (0.45, 0.1, 0.05, *UP), "right": (0.5, -0.1, 0.05, *UP)},
    "plane": {
        "table": (0.5, 0.0, 0.02, *UP),
        "front": (0.7, 0.0, 0.3, -1.0, 0.0, 0.0),
        "side": (0.4, 0.4, 0.3, 0.0, -1.0, 0.0),
    },
    "sphere": {"ball": (0.5, 0.0, 0.1, 0.02), "other": (0.4, 0.3, 0.1, 0.02)},
    "distance": {"left": (1, 1, 0), "right": (1, -1, 0), "above": (0, 0, 1.5)},
    "line": {
        "across": (0.5, 0.0, 0.4, 1.0, 0.0, 0.0),
        "up": (0.5, 0.1, 0.4, *UP),
    },
    "board": {"board": (0.5, 0.0, 0.02, *UP)},
}
# A camera on a stand before the robot that looks back and down.
BESIDE = (1.2, 0.0, 0.6, -1.0, 0.0, -0.2)
# The flange of the Panda is on the negative side of its last frame.
MOUNT_M = np.array([0.0, 0.0, -0.1])


def make_kind_survey(name, camera="on_robot", place=None):
    """Make a survey of a kind whose features stand before a Panda."""
    robot = analysed("panda")
    kind = list_kinds()[name]
    places = PLACES[name]
    if camera == "beside_robot":
        places = {"camera": BESIDE}
    if place is not None:
        places = {next(iter(places)): place}
    places = {name: np.array(numbers, float) for name, numbers in places.items()}
    if "nx" in kind.place_keys:
        for numbers in places.values():
            numbers[3:] /= np.linalg.norm(numbers[3:])
    point = robot.chain.end_effector
    rotation = orient_mount(kind, robot.chain, point, MOUNT_M)
    options = {**kind.limits, "camera": camera}
    setup = SetUp(kind, places, point.name, MOUNT_M, rotation, options)
    return Survey(
        robot,
        (Target("tip", point.name, None),),
        name == "board",
        name,
        kind.sensor.position_m,
        kind.sensor.orientation_rad,
        setup=setup,
    )
