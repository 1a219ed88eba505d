"""URDFs of robots that config/robots does not have, with meshes, inertias, limits and a gripper; sizes are invented."""

import struct

import numpy as np

# Each: name, type, parent, child, origin (x, y, z), roll-pitch-yaw, axis; links weigh as in `MASSES`, with their centres.
SIX = {
    "base": "base_link",
    "tip": "tool0",
    "joints": (
        ("shoulder_pan", "revolute", "base_link", "column", (0, 0, 0.45), (0, 0, 0), (0, 0, 1)),
        ("shoulder_lift", "revolute", "column", "arm", (0.16, 0, 0.14), (0, 0, 0), (0, 1, 0)),
        ("elbow", "revolute", "arm", "elbow_block", (0, 0, 0.72), (0, 0, 0), (0, 1, 0)),
        ("forearm_roll", "revolute", "elbow_block", "forearm", (0.11, 0, 0.06), (0, 0, 0), (1, 0, 0)),
        ("wrist_bend", "revolute", "forearm", "wrist", (0.62, 0, 0), (0, 0, 0), (0, 1, 0)),
        ("flange_roll", "revolute", "wrist", "flange", (0.09, 0, 0), (0, 0, 0), (1, 0, 0)),
    ),
    "masses": {"column": 48.0, "arm": 40.0, "elbow_block": 26.0, "forearm": 17.0, "wrist": 6.0, "flange": 1.2},
    "force_N": 200,
}
SEVEN = {
    "base": "pedestal",
    "tip": "tool0",
    "joints": (
        ("a1", "revolute", "pedestal", "l1", (0, 0, 0.34), (0, 0, 0), (0, 0, 1)),
        ("a2", "revolute", "l1", "l2", (0, 0, 0), (0, 0, 0), (0, 1, 0)),
        ("a3", "revolute", "l2", "l3", (0, 0, 0.4), (0, 0, 0), (0, 0, 1)),
        ("a4", "revolute", "l3", "l4", (0, 0, 0), (0, 0, 0), (0, -1, 0)),
        ("a5", "revolute", "l4", "l5", (0, 0, 0.4), (0, 0, 0.2), (0, 0, 1)),
        ("a6", "revolute", "l5", "l6", (0, 0, 0), (0, 0, 0), (0, 1, 0)),
        ("a7", "revolute", "l6", "l7", (0.05, 0, 0.12), (0, 0, 0), (0, 0, 1)),
    ),
    "masses": {"l1": 5.1, "l2": 4.2, "l3": 3.6, "l4": 3.2, "l5": 2.4, "l6": 1.9, "l7": 0.6},
    "force_N": 60,
}
_LINK = """  <link name="{name}">
    <inertial><origin xyz="{centre}"/><mass value="{mass}"/>
      <inertia ixx="0.31" ixy="0.01" ixz="0.002" iyy="0.32" iyz="-0.003" izz="0.29"/></inertial>
    <visual><geometry><mesh filename="part.stl" scale="0.5 0.5 0.5"/></geometry></visual>
    <collision><geometry><mesh filename="part.stl" scale="0.5 0.5 0.5"/></geometry></collision>
  </link>
"""
_JOINT = """  <joint name="{name}" type="{kind}">
    <origin xyz="{origin}" rpy="{turn}"/><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>
    <limit lower="{low}" upper="{high}" effort="321" velocity="3.5"/><dynamics damping="0.7"/>{mimic}
  </joint>
"""


def foreign_urdf(described):
    """The URDF of one of the robots, with a gripper of two fingers, of which one follows the other."""
    last, masses = described["joints"][-1][3], described["masses"]
    fingers = [
        (f"finger{n}_slide", "prismatic", last, f"finger{n}", (0.1, side, 0), (0, 0, 0), (0, side, 0))
        for n, side in ((1, 0.03), (2, -0.03))
    ]
    parts = ['<?xml version="1.0"?>\n<!-- Zelle 7 -->\n<robot name="foreign">\n', f'  <link name="{described["base"]}"/>\n']
    ahead = {joint[2]: joint[4] for joint in described["joints"][1:]}
    for link, mass in masses.items():
        centre = _numbers(0.45 * np.array(ahead.get(link, (0.02, 0, 0.03))))
        parts.append(_LINK.format(name=link, mass=mass, centre=centre))
    parts += [_LINK.format(name=f"finger{n}", mass=0.05, centre="0 0 0") for n in (1, 2)]
    parts.append('  <link name="tool0"/>\n  <joint name="tool" type="fixed"><origin xyz="0.08 0 0.02" rpy="0 1.5707963 0"/>')
    parts.append(f'<parent link="{last}"/><child link="tool0"/></joint>\n')
    for name, kind, parent, child, origin, turn, axis in (*described["joints"], *fingers):
        low, high = ("0", "0.04") if kind == "prismatic" else ("-2.6", "2.6")
        mimic = '\n    <mimic joint="finger1_slide" multiplier="1" offset="0"/>' if name == "finger2_slide" else ""
        numbers = {"origin": _numbers(origin), "turn": _numbers(turn), "axis": _numbers(np.sign(axis))}
        parts.append(
            _JOINT.format(name=name, kind=kind, parent=parent, child=child, low=low, high=high, mimic=mimic, **numbers)
        )
    return "".join([*parts, "</robot>\n"])


def mesh():
    """A tetrahedron as binary STL."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + body


def _numbers(values):
    return " ".join(f"{value:.6g}" for value in values)
