"""An arm as its robot file describes it, read by a parser of its own, and what its
links weigh.

The file's chain is a product of elementary transforms, ``Tz(l1) Rz(q1) Tx(l2) [2DoF]
...``. Here it becomes a list of rigid stretches with a drive between each two of them,
which is what a multibody model is built from.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError

_USUAL_RATIOS = (191.25, 171.74, 153.4, 129.6, 118.9, 101.0, 101.0)
# What counts as heavy, and gears as stiff as a heavy arm's.
_HEAVY_KG = 140.0
_STIFF_RAD_PER_NM = 2e-6
# A file without compliances is of an arm whose gears wind up by two milliradians under
# the rated load at the longest lever, of 0.2 m at least: what makers of cycloidal and
# strain wave gears state for the rated torque, 3 to 7 arc minutes.
_WIND_UP_RAD = 2e-3
_SHORTEST_LEVER_M = 0.2
_LEAST_KG = 1.0
_WORD = re.compile(r"([TR])([xyz])\((-?)([\w.]+)\)|\[([^\]]+)\]")
# Mass of an arm by rated load (kg) times reach (m): m = 3.2 (P R)^0.92 goes through an
# arm of 30 kg for 14 kg at 0.82 m and has 1380 kg for 270 kg at 2.7 m, where a data
# sheet has 1130: a size to be expected, not the mass of one machine.
_SCALE_KG = 3.2
_POWER = 0.92
# Of it in the foot and in the carousel with its motors; the rest halves from link to
# link.
_FOOT = 0.18
_CAROUSEL = 0.27
_FALL = 0.5
_ALONG = 0.45
_ASIDE = 0.01
_RELATIVE_STD = 0.1
# A centre that lies on its joint's axis is known no better than this.
_SHORTEST_CENTRE_M = 0.1
# Standard deviations; beyond them nobody's declaration would be believed.
_FARTHEST = 3.0


@dataclass(frozen=True)
class Link:
    """What is rigid between two drives: vector (3,) from its near to its far end,
    rotation (3, 3) of the frame at its far end, and places (3,) and rotations (3, 3) of
    its measuring points by their names, all in the frame at its near end."""

    vector_m: np.ndarray
    rotation: np.ndarray
    points: dict[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class LinkMass:
    """What one link weighs.

    `link`: 0 is the column; k turns with joint k. `centre_m`: in the frame directly
    behind the rotation of joint `link`; of the column in the axes of the base.
    `relative_std`: of the mass; of each component of the centre as a share of its
    distance. `along`: where on the link it sits, 0 at its near end, 1 at its far end;
    None where it is nearest.
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float = _RELATIVE_STD
    along: float | None = None

    def centre_std_m(self, least_m: float = _SHORTEST_CENTRE_M) -> float:
        """Standard deviation of each component of the declared centre, m, whose
        distance counts as `least_m` at least."""
        return self.relative_std * max(float(np.linalg.norm(self.centre_m)), least_m)


@dataclass(frozen=True)
class Arm:
    """An arm, all fixed rotations and lengths sorted into stretches; what its file does
    not state is usual for its size.

    `stretches`: n + 1 of them: the column, and one behind each drive; `lengths_m` (n +
    1,). `reach_m`: of all that joint 1 carries, stretched out. `axes` (n, 3): axis of
    each drive with its sense, in the frame at the far end of the stretch before it.
    `compliance` (n,): rad/(N m); a specimen has others. `softness`: how many times
    softer these are than a heavy arm's, at least 1; `load_share`: how large its loads
    are beside a heavy arm's, at most 1. `limits` (n, 2): rad. `masses`: as declared.
    `gravity_m_s2`: in the axes of the base. `compensated`: by a gravity compensator at
    the shoulder. `gear_ratio`: turns of the motor for one of each joint.
    """

    stretches: tuple[Link, ...]
    lengths_m: np.ndarray
    reach_m: float
    axes: np.ndarray
    compliance: np.ndarray
    softness: float
    limits: np.ndarray
    masses: tuple[LinkMass, ...]
    gravity_m_s2: tuple[float, ...]
    payload_kg: float
    load_share: float
    compensated: bool
    gear_ratio: tuple[float, ...]

    @property
    def joints(self) -> int:
        """Number of drives, n."""
        return len(self.axes)

    @property
    def points(self) -> tuple[str, ...]:
        """Names of all measuring points, the flange last."""
        return tuple(name for stretch in self.stretches for name in stretch.points)


def read_arm(path: str | Path) -> Arm:
    """Read a robot file that the analysis can read too."""
    return build_arm(
        yaml.safe_load(Path(path).read_text(encoding="utf-8")), Path(path).as_posix()
    )


def build_arm(document: Mapping[str, Any], source: str = "robot") -> Arm:
    """Make an arm of the contents of a robot file.

    `source`: named in errors. Raises `InputError`: a drive that shifts or that stands
    in two places, or a controller that shows other angles than those of the joints.
    """
    if "reported_joints" in document:
        raise InputError(
            source,
            "reported_joints",
            "other angles than the joints'",
            "none, of a robot that is simulated",
        )
    stretches, axes = _stretches_of(
        document["chain"], document.get("lengths_m", {}), source
    )
    n = len(axes)
    lengths = np.array([np.linalg.norm(stretch.vector_m) for stretch in stretches])
    reach = float(sum(lengths[1:]))
    # Arms of 1 to 3 m carry 8 kg m^-3 times the cube of their reach.
    payload = document.get("payload_kg", 8.0 * reach**3)
    behind = np.cumsum(lengths[:0:-1])[::-1]
    compliance = _WIND_UP_RAD / (
        standard_gravity
        * max(payload, _LEAST_KG)
        * np.maximum(behind, _SHORTEST_LEVER_M)
    )
    if "compliance_urad_per_Nm" in document:
        compliance = 1e-6 * np.array(document["compliance_urad_per_Nm"], float)
    masses = [
        LinkMass(**mass | {"centre_m": tuple(map(float, mass["centre_m"]))})
        for mass in document.get("masses", ())
    ]
    return Arm(
        stretches,
        lengths,
        reach,
        axes,
        compliance,
        max(1.0, float(np.median(compliance)) / _STIFF_RAD_PER_NM),
        np.radians(
            np.array(document.get("joint_limits_deg", [[-360.0, 360.0]] * n), float)
        ),
        tuple(masses or _usual_masses(stretches, payload * reach, reach)),
        tuple(map(float, document.get("gravity_m_s2", (0.0, 0.0, -standard_gravity)))),
        payload,
        min(1.0, payload / _HEAVY_KG),
        # A file that declares no weights declares no compensator either.
        "compensator" in document or not masses,
        tuple(
            document.get(
                "gear_ratio",
                [_USUAL_RATIOS[joint % len(_USUAL_RATIOS)] for joint in range(n)],
            )
        ),
    )


def _usual_masses(
    stretches: tuple[Link, ...], payload_times_reach: float, reach: float
) -> list[LinkMass]:
    """What the links of an arm weigh of which nobody says it."""
    falling = _FALL ** np.arange(len(stretches) - 2)
    shares = [_FOOT, _CAROUSEL, *((1.0 - _FOOT - _CAROUSEL) * falling / falling.sum())]
    # Centres before the middle of the link, and a little to the side, where the motors
    # sit; to the millimetre.
    centres = [
        np.round(_ALONG * stretch.vector_m + np.array([0.0, _ASIDE * reach, 0.0]), 3)
        for stretch in stretches
    ]
    total = _SCALE_KG * payload_times_reach**_POWER
    return [
        LinkMass(link, round(float(share * total), 1), tuple(centres[link].tolist()))
        for link, share in enumerate(shares)
    ]


def _stretches_of(
    chain: str, lengths: Mapping[str, float], source: str
) -> tuple[tuple[Link, ...], np.ndarray]:
    """Cut a chain at its drives."""
    stretches: list[Link] = []
    axes: list[np.ndarray] = []
    position = np.zeros(3)
    rotation = np.eye(3)
    points = {}
    for kind, axis, minus, argument, point in _WORD.findall(chain):
        if point:
            points[point] = position, rotation
            continue
        sign = -1.0 if minus else 1.0
        direction = np.eye(3)["xyz".index(axis)]
        if re.fullmatch(r"q\d+", argument) and (kind, argument) != (
            "R",
            f"q{len(axes) + 1}",
        ):
            found = f"{kind}{axis}({minus}{argument})"
            raise InputError(
                source,
                "chain",
                found,
                f"drives that turn, each in one place: R.(q{len(axes) + 1})",
            )
        if kind == "T":
            position = position + rotation @ (
                sign * float(lengths.get(argument, argument)) * direction
            )
        elif argument.endswith("deg"):
            rotation = rotation @ to_rotation_matrix(
                np.radians(sign * float(argument[:-3])) * direction
            )
        else:
            stretches.append(Link(position, rotation, points))
            axes.append(sign * direction)
            position = np.zeros(3)
            rotation = np.eye(3)
            points = {}
    return (*stretches, Link(position, rotation, points)), np.array(axes)


def to_rotation_matrix(vector: ArrayLike) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    return Rotation.from_rotvec(np.array(vector, float)).as_matrix()


def to_rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3); angles up to
    and at a half turn."""
    # A product of two rotations is one but for rounding, which needs no other to be
    # found for it.
    return Rotation.from_matrix(np.array(rotation), assume_valid=True).as_rotvec()


def draw_true_masses(
    arm: Arm,
    draws: np.random.Generator,
    off_line_m: float,
    sideways: np.random.Generator,
) -> tuple[LinkMass, ...]:
    """Masses and centres of one specimen, drawn about the declared ones as well as
    these are known.

    `off_line_m`: by how much centres lie off the lines of their links at most, in each
    direction across, as nobody declared.
    """
    found = []
    for mass in arm.masses:
        heavier, *moved = np.clip(draws.standard_normal(4), -_FARTHEST, _FARTHEST)
        centre = np.array(mass.centre_m) + mass.centre_std_m() * np.array(moved)
        if off_line_m:
            move = sideways.uniform(-off_line_m, off_line_m, 3)
            vector = arm.stretches[mass.link].vector_m
            along = vector / max(float(np.linalg.norm(vector)), 1e-300)
            centre = centre + move - (move @ along) * along
        found.append(
            replace(
                mass,
                mass_kg=mass.mass_kg * (1.0 + mass.relative_std * heavier),
                centre_m=tuple(centre),
            )
        )
    return tuple(found)
