"""The kinematics file of a calibrated robot, as the ROS drivers of Universal Robots write it, to the contents of a robot file.

``kinematics`` has a fixed transform before each joint, ``{x, y, z, roll, pitch, yaw}`` (m, rad), as ``origin`` of a URDF [1];
the joint turns about z. The base frame is that of the controller (``base`` of ur_description, not ``base_link``).

[1] Universal Robots, ur_calibration: extracts the factory calibration of a robot, github.com/UniversalRobots.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import displacement_words, origin_transform
from elastocal.exchange.robot_text import Imported, check_imported
from elastocal.exchange.urdf_chain import point_name
from elastocal.io.texts import A_NUMBER, plain_number

KINEMATICS = "kinematics"
_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
# Links of Universal Robots and the joints before them; of other robots both have the name that the file has.
_JOINTS = {
    "shoulder": "shoulder_pan_joint",
    "upper_arm": "shoulder_lift_joint",
    "forearm": "elbow_joint",
    "wrist_1": "wrist_1_joint",
    "wrist_2": "wrist_2_joint",
    "wrist_3": "wrist_3_joint",
}


def robot_from_kinematics(document: Mapping[str, Any], path: str | Path, name: str | None = None) -> Imported:
    """The robot of a kinematics file, its links in the order of the arm; other keys and what is no number are refused."""
    source = Path(path).as_posix()
    described = document[KINEMATICS]
    if not isinstance(described, dict):
        raise InputError(source, KINEMATICS, type(described).__name__, f"links, each with {', '.join(_KEYS)}")
    # A digest of the calibration stands beside the links.
    links = {str(link): origin for link, origin in described.items() if link != "hash"}
    if not links:
        raise InputError(source, KINEMATICS, "no link", f"links, each with {', '.join(_KEYS)}")
    if set(links) <= {*_JOINTS}:
        links = {link: links[link] for link in _JOINTS if link in links}
        if missing := [link for link in [*_JOINTS][: [*_JOINTS].index([*links][-1])] if link not in links]:
            raise InputError(source, KINEMATICS, f"no link {missing[0]}", f"every link before {[*links][-1]}")
    words: list[str] = []
    for number, (link, origin) in enumerate(links.items(), 1):
        words += [*displacement_words(_transform(origin, f"{KINEMATICS}.{link}", source)), f"Rz(q{number})"]
    words.append(f"[{point_name([*links][-1])}]")
    names = [_JOINTS.get(link, link) for link in links]
    contents = {"name": name or Path(path).stem, "joint_names": names, "chain": " ".join(words)}
    notes = [
        f"read: {', '.join(f'q{n} is {name} of {link!r}' for n, (name, link) in enumerate(zip(names, links, strict=True), 1))}",
        *(["not used: hash"] if "hash" in described else []),
        "no masses: the weight of the links is not known",
        "no limits of any joint: a turn either way",
        "base axes are the controller's (base, not base_link, which is turned half round)",
    ]
    return check_imported(contents, path, "the kinematics of a calibrated robot as ROS has them", notes)


def _transform(origin: object, where: str, source: str) -> np.ndarray:
    if not isinstance(origin, dict) or set(origin) != set(_KEYS):
        found = ", ".join(map(str, origin)) if isinstance(origin, dict) else type(origin).__name__
        raise InputError(source, where, found or "nothing", ", ".join(_KEYS))
    values: list[float] = []
    for key in _KEYS:
        value = plain_number(str(origin[key]))
        if value is None:
            raise InputError(source, f"{where}.{key}", repr(origin[key]), A_NUMBER)
        values.append(value)
    return origin_transform(values[:3], values[3:])
