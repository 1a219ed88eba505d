"""Joint states as rosbag and PlotJuggler write them: ``position0`` beside ``name0``, whose cells name the joint.

Messages of joint states have joints in any order, often that of the alphabet [1], so a position counts for the joint that its
name says and not for its place.

[1] Open Robotics, sensor_msgs/JointState, docs.ros.org.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from elastocal.errors import InputError
from elastocal.exchange.column_names import recognized, unit_of_joint, without_unit
from elastocal.exchange.csv_dialect import TextTable

_COUNTED = re.compile(r"(.*?)(name|position)s?[\s_.]?[\[(]?\s*([0-9]{1,2})\s*[\])]?", re.ASCII | re.IGNORECASE)


def joints_by_name(text: TextTable, joint_names: Sequence[str], mapped: set[str]) -> dict[str, str]:
    """Names of joint angles by the headers of positions beside which columns name the joints.

    `joint_names`: as the robot has them; empty where nobody knows. `mapped`: headers that options state. Raises `InputError`:
    a name that changes from row to row, or joints whose order nothing states.
    """
    families: dict[tuple[str, str], dict[int, str]] = {}
    for header in text.columns:
        if match := _COUNTED.fullmatch(without_unit(header)[0]):
            families.setdefault((match[1], match[2].lower()), {})[int(match[3])] = header
    found: dict[str, str] = {}
    for (prefix, kind), names in families.items():
        positions = families.get((prefix, "position"), {})
        if kind != "name" or positions.keys() != names.keys() or mapped & {*positions.values()}:
            continue
        for number, header in names.items():
            if other := next((cell for cell in text.columns[header] if cell != text.columns[header][0]), None):
                line = text.lines[text.columns[header].index(other)]
                allowed = f"one joint in each column; it is {text.columns[header][0]!r} in line {text.lines[0]}"
                raise InputError(text.path, f"line {line}, column {header}", repr(other), allowed)
            called = text.columns[header][0]
            joint = next((f"q{j}" for j, name in enumerate(joint_names, 1) if unit_of_joint(called, name)[0]), None)
            joint = joint or (None if joint_names else recognized(called)[0])
            if joint and re.fullmatch("q[0-9]+", joint):
                found[positions[number]] = joint
        if not found:
            called = ", ".join(text.columns[header][0] for header in names.values())
            allowed = (
                f"--robot FILE whose joint_names are these, or --column q1={next(iter(positions.values()))!r} …, each joint's"
            )
            raise InputError(text.path, "header", f"joints called {called}, in an order that need not be the arm's", allowed)
    return found
