"""An arm as its robot file describes it, read by a parser of its own, and what its links weigh.

The file's chain is a product of elementary transforms, ``Tz(l1) Rz(q1) Tx(l2) [2DoF] ...``. Here it becomes a list of rigid
stretches with a drive between each two of them, which is what a multibody model is built from.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from scipy.constants import g as standard_gravity
from scipy.spatial.transform import Rotation

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike

_USUAL_RATIOS = (191.25, 171.74, 153.4, 129.6, 118.9, 101.0, 101.0)
# What counts as heavy, and gears as stiff as a heavy arm's.
_HEAVY_KG, _STIFF_RAD_PER_NM = 140.0, 2e-6
# A file without compliances is of an arm whose gears wind up by two milliradians under the rated load at the longest lever, of
# 0.2 m at least: what makers of cycloidal and strain wave gears state for the rated torque, 3 to 7 arc minutes.
_WIND_UP_RAD, _SHORTEST_LEVER_M, _LEAST_KG = 2e-3, 0.2, 1.0
_WORD = re.compile(r"([TR])([xyz])\((-?)([\w.]+)\)|\[([^\]]+)\]")
# Mass of an arm by rated load (kg) times reach (m): m = 3.2 (P R)^0.92 goes through an arm of 30 kg for 14 kg at 0.82 m and has
# 1380 kg for 270 kg at 2.7 m, where a data sheet has 1130: a size to be expected, not the mass of one machine.
_SCALE_KG, _POWER = 3.2, 0.92
# Of it in the foot and in the carousel with its motors; the rest halves from link to link.
_FOOT, _CAROUSEL, _FALL = 0.18, 0.27, 0.5
_ALONG, _ASIDE, _RELATIVE_STD = 0.45, 0.01, 0.1
# A centre that lies on its joint's axis is known no better than this.
_SHORTEST_CENTRE_M = 0.1
# Width of a link over the reach of the arm: within it centres of mass lie anywhere.
_WIDTH_OF_REACH = 0.1
# Standard deviations; beyond them nobody's declaration would be believed.
_FARTHEST = 3.0


@dataclass(frozen=True)
class Point:
    """A measuring point on a stretch: its place (3,) and rotation (3, 3) in the frame at the near end of the stretch."""

    name: str
    position_m: np.ndarray
    rotation: np.ndarray


@dataclass(frozen=True)
class Stretch:
    """What is rigid between two drives: vector (3,) from its near to its far end, and rotation (3, 3) of the frame at its far
    end, both in the frame at its near end."""

    vector_m: np.ndarray
    rotation: np.ndarray
    points: tuple[Point, ...]


@dataclass(frozen=True)
class LinkMass:
    """What one link weighs.

    `link`: 0 is the column; k turns with joint k. `centre_m`: in the frame directly behind the rotation of joint `link`; of the
    column in the axes of the base. `relative_std`: of the mass; of each component of the centre as a share of its distance.
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float = _RELATIVE_STD

    def centre_std_m(self, least_m: float = _SHORTEST_CENTRE_M) -> float:
        """Standard deviation of each component of the declared centre, m: its share of the centre's distance."""
        return self.relative_std * max(float(np.linalg.norm(self.centre_m)), least_m)

    def allowed_centre_std_m(self, reach_m: float) -> float:
        """The same as an analyst must allow it, who does not know how far aside the centre lies."""
        return self.centre_std_m(_WIDTH_OF_REACH * reach_m)


@dataclass(frozen=True)
class Arm:
    """An arm, all fixed rotations and lengths sorted into stretches; what its file does not state is usual for its size.

    `stretches`: n + 1 of them: the column, and one behind each drive. `axes` (n, 3): axis of each drive with its sense, in the
    frame at the far end of the stretch before it. `compliance` (n,): rad/(N m); a specimen's own differs. `limits` (n, 2): rad.
    `reported_matrix`, `reported_offset` (n, n), (n,): angles from what the controller shows: q = matrix @ shown + offset.
    `masses`: as declared. `gravity_m_s2`: in the axes of the base. `compensated`: by a gravity compensator at the shoulder.
    `gear_ratio`: turns of the motor for one of each joint.
    """

    name: str
    stretches: tuple[Stretch, ...]
    axes: np.ndarray
    compliance: np.ndarray
    limits: np.ndarray
    reported_matrix: np.ndarray
    reported_offset: np.ndarray
    masses: tuple[LinkMass, ...]
    gravity_m_s2: tuple[float, ...]
    payload_kg: float
    compensated: bool
    gear_ratio: tuple[float, ...]

    @property
    def joints(self) -> int:
        """Number of drives, n."""
        return len(self.axes)

    @cached_property
    def lengths_m(self) -> np.ndarray:
        """Of all stretches, (n + 1,)."""
        return _lengths_of(self.stretches)

    @property
    def reach_m(self) -> float:
        """Length of all that joint 1 carries, stretched out."""
        return float(sum(self.lengths_m[1:]))

    @property
    def load_share(self) -> float:
        """How large its loads are beside a heavy arm's, at most 1."""
        return min(1.0, self.payload_kg / _HEAVY_KG)

    @property
    def softness(self) -> float:
        """How many times softer the gears are than a heavy arm's, at least 1."""
        return max(1.0, float(np.median(self.compliance)) / _STIFF_RAD_PER_NM)

    @property
    def points(self) -> tuple[str, ...]:
        """Names of all measuring points, the flange last."""
        return tuple(point.name for stretch in self.stretches for point in stretch.points)

    def shown_angles(self, angles: np.ndarray) -> np.ndarray:
        """What the controller shows, (S, n), for angles (S, n), rad."""
        return np.linalg.solve(self.reported_matrix, (angles - self.reported_offset).T).T

    def angles_shown_as(self, shown: np.ndarray) -> np.ndarray:
        """Angles (S, n) for which the controller shows these (S, n), rad."""
        return shown @ self.reported_matrix.T + self.reported_offset


def arm_from_file(path: str | Path) -> Arm:
    """Read a robot file."""
    return arm_from_document(yaml.safe_load(Path(path).read_text(encoding="utf-8")), Path(path).as_posix())


def arm_from_document(document: Mapping[str, Any], source: str = "robot") -> Arm:
    """Make an arm of the contents of a robot file.

    `source`: named in errors. Raises `InputError`: a word of the chain that is none, a drive that shifts or that stands in two
    places, or a chain that does not end in a measuring point.
    """
    stretches, axes = _stretches_of(document["chain"], document.get("lengths_m", {}), source)
    n, shown, lengths = len(axes), document.get("reported_joints", {}), _lengths_of(stretches)
    reach = float(sum(lengths[1:]))
    # Arms of 1 to 3 m carry 8 kg m^-3 times the cube of their reach.
    payload = document.get("payload_kg", 8.0 * reach**3)
    behind = np.cumsum(lengths[:0:-1])[::-1]
    compliance = _WIND_UP_RAD / (standard_gravity * max(payload, _LEAST_KG) * np.maximum(behind, _SHORTEST_LEVER_M))
    if "compliance_urad_per_Nm" in document:
        compliance = 1e-6 * np.array(document["compliance_urad_per_Nm"], float)
    masses = [LinkMass(**mass | {"centre_m": tuple(map(float, mass["centre_m"]))}) for mass in document.get("masses", ())]
    return Arm(
        document["name"],
        stretches,
        axes,
        compliance,
        np.radians(np.array(document.get("joint_limits_deg", [[-360.0, 360.0]] * n), float)),
        np.array(shown.get("matrix", np.eye(n)), float),
        np.radians(np.array(shown.get("offset_deg", np.zeros(n)), float)),
        tuple(masses or _usual_masses(stretches, payload * reach, reach)),
        tuple(map(float, document.get("gravity_m_s2", (0.0, 0.0, -standard_gravity)))),
        payload,
        # A file that declares no weights declares no compensator either.
        "compensator" in document or not masses,
        tuple(document.get("gear_ratio", [_USUAL_RATIOS[joint % len(_USUAL_RATIOS)] for joint in range(n)])),
    )


def _lengths_of(stretches: Iterable[Stretch]) -> np.ndarray:
    return np.array([np.linalg.norm(stretch.vector_m) for stretch in stretches])


def _usual_masses(stretches: Sequence[Stretch], payload_times_reach: float, reach: float) -> list[LinkMass]:
    """What the links of an arm weigh of which nobody says it."""
    falling = _FALL ** np.arange(len(stretches) - 2)
    shares = [_FOOT, _CAROUSEL, *((1.0 - _FOOT - _CAROUSEL) * falling / falling.sum())]
    # Centres before the middle of the link, and a little to the side, where the motors sit; to the millimetre.
    centres = [np.round(_ALONG * stretch.vector_m + np.array([0.0, _ASIDE * reach, 0.0]), 3) for stretch in stretches]
    total = _SCALE_KG * payload_times_reach**_POWER
    return [LinkMass(link, round(float(share * total), 1), tuple(centres[link].tolist())) for link, share in enumerate(shares)]


def _stretches_of(chain: str, lengths: Mapping[str, float], source: str) -> tuple[tuple[Stretch, ...], np.ndarray]:
    """Cut a chain at its drives."""
    stretches: list[Stretch] = []
    axes: list[np.ndarray] = []
    position, rotation, points = np.zeros(3), np.eye(3), []
    for word in chain.split():
        match = _WORD.fullmatch(word)
        if match is None:
            raise InputError(source, "chain", repr(word), "T or R of x, y, z, or a [POINT]")
        kind, axis, minus, argument, point = match.groups()
        if point:
            points.append(Point(point, position, rotation))
            continue
        sign, direction = (-1.0 if minus else 1.0), np.eye(3)["xyz".index(axis)]
        if re.fullmatch(r"q\d+", argument) and (kind, argument) != ("R", f"q{len(axes) + 1}"):
            raise InputError(source, "chain", repr(word), f"drives that turn, each in one place: R.(q{len(axes) + 1})")
        if kind == "T":
            position = position + rotation @ (sign * float(lengths.get(argument, argument)) * direction)
        elif argument.endswith("deg"):
            rotation = rotation @ turned(np.radians(sign * float(argument[:-3])) * direction)
        else:
            stretches.append(Stretch(position, rotation, tuple(points)))
            axes.append(sign * direction)
            position, rotation, points = np.zeros(3), np.eye(3), []
    if not points or not np.array_equal(points[-1].position_m, position):
        raise InputError(source, "chain", "no measuring point at its end", "a chain that ends in one")
    return (*stretches, Stretch(position, rotation, tuple(points))), np.array(axes)


def turned(vector: ArrayLike) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    return Rotation.from_rotvec(np.array(vector, float)).as_matrix()


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3); angles up to and at a half turn."""
    # A product of two rotations is one but for rounding, which needs no other to be found for it.
    return Rotation.from_matrix(np.array(rotation), assume_valid=True).as_rotvec()


def true_masses(masses: Iterable[LinkMass], draws: np.random.Generator) -> tuple[LinkMass, ...]:
    """Masses and centres of one specimen, drawn about the declared ones as well as these are known."""
    found = []
    for mass in masses:
        heavier, *moved = np.clip(draws.standard_normal(4), -_FARTHEST, _FARTHEST)
        centre = np.array(mass.centre_m) + mass.centre_std_m() * np.array(moved)
        found.append(replace(mass, mass_kg=mass.mass_kg * (1.0 + mass.relative_std * heavier), centre_m=tuple(centre)))
    return tuple(found)


def off_the_line(masses: Iterable[LinkMass], arm: Arm, largest_m: float, draws: np.random.Generator) -> tuple[LinkMass, ...]:
    """Centres moved off the lines of their links by up to a distance in each direction across, as nobody declared."""
    found = []
    for mass in masses:
        move, vector = draws.uniform(-largest_m, largest_m, 3), arm.stretches[mass.link].vector_m
        if vector.any():
            along = vector / np.linalg.norm(vector)
            move = move - (move @ along) * along
        found.append(replace(mass, centre_m=tuple(np.array(mass.centre_m) + move)))
    return tuple(found)
