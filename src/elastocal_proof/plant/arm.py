"""Read the arm of a robot file with an independent parser, and estimate the weights of
its links.

The file's chain is a product of elementary transforms, ``Tz(l1) Rz(q1) Tx(l2) [2DoF]
...``. This module turns it into a list of rigid links with one drive between each pair
of neighbours, which is what a multibody model is built from.
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

# Gear ratios of an arm whose file declares none: those of a heavy industrial arm.
_TYPICAL_GEAR_RATIOS = (191.25, 171.74, 153.4, 129.6, 118.9, 101.0, 101.0)
# Payload and joint compliance of a heavy arm, to which other arms are compared.
_HEAVY_PAYLOAD_KG = 140.0
_HEAVY_COMPLIANCE_RAD_PER_NM = 2e-6
# If a file declares no compliances, the gears wind up by two milliradians under the
# rated load at the longest lever. Makers of cycloidal and strain wave gears state 3 to
# 7 arc minutes at the rated torque. Lower bounds on the lever and on the load keep the
# compliance finite.
_WIND_UP_RAD = 2e-3
_MIN_LEVER_M = 0.2
_MIN_PAYLOAD_KG = 1.0
_CHAIN_TERM = re.compile(r"([TR])([xyz])\((-?)([\w.]+)\)|\[([^\]]+)\]")
# Mass of an arm by payload P (kg) and reach R (m): m = 3.2 (P R)^0.92. It fits an arm of
# 30 kg for 14 kg at 0.82 m and gives 1380 kg for 270 kg at 2.7 m, where a data sheet
# states 1130 kg: an order of magnitude, not the mass of one machine.
_MASS_SCALE_KG = 3.2
_MASS_EXPONENT = 0.92
# Shares of the mass in the foot and in the carousel with its motors. The other links
# share the remainder, each half as heavy as the one before.
_FOOT_SHARE = 0.18
_CAROUSEL_SHARE = 0.27
_LINK_MASS_RATIO = 0.5
# Centres lie before the middle of the link (share of its length) and a little to the
# side (share of the reach), where the motors sit.
_CENTRE_ALONG = 0.45
_CENTRE_ASIDE = 0.01
# Relative standard deviation of a declared mass, if the file states none.
_RELATIVE_STD = 0.1
# Lower bound on the distance that scales the uncertainty of a centre: a centre on its
# joint's axis is not known exactly.
_MIN_CENTRE_DISTANCE_M = 0.1
# Largest deviation of a mass or centre, in standard deviations. Beyond it nobody would
# believe the declaration.
_MAX_DEVIATION = 3.0


@dataclass(frozen=True)
class Link:
    """A rigid body between two drives; the first one is the column.

    Attributes
    ----------
    vector_m : (3,) array
        From the link's near end to its far end, in the frame at the near end.
    rotation : (3, 3) array
        Of the frame at the far end, in the frame at the near end.
    points : dict
        Measuring points by name: position (3,), m, and rotation (3, 3), in the frame at
        the near end.
    """

    vector_m: np.ndarray
    rotation: np.ndarray
    points: dict[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class LinkMass:
    """Mass and centre of one link.

    Attributes
    ----------
    link
        Number of the link: 0 is the column, k turns with joint k.
    mass_kg
        Mass.
    centre_m
        In the frame directly behind the rotation of joint `link`; for the column in the
        axes of the base.
    relative_std
        Standard deviation of the mass, and of each component of the centre as a share
        of its distance.
    along
        Position on the link, from 0 at its near end to 1 at its far end; None for the
        point nearest to the centre.
    """

    link: int
    mass_kg: float
    centre_m: tuple[float, ...]
    relative_std: float = _RELATIVE_STD
    along: float | None = None

    def centre_std_m(self, min_distance_m: float = _MIN_CENTRE_DISTANCE_M) -> float:
        """Standard deviation of each component of the declared centre, m.

        It is a share of the centre's distance, which counts as at least
        `min_distance_m`.
        """
        distance = float(np.linalg.norm(self.centre_m))
        return self.relative_std * max(distance, min_distance_m)


@dataclass(frozen=True)
class Arm:
    """An arm as its robot file declares it; undeclared values are typical of its size.

    Attributes
    ----------
    links : tuple of n + 1 links
        The column, and one link behind each drive.
    lengths_m : (n + 1,) array
        Length of each link.
    reach_m : float
        Sum of the lengths of all links that joint 1 moves.
    axes : (n, 3) array
        Axis of each drive with its sense, in the frame at the far end of the link
        before it.
    compliance : (n,) array
        Declared joint compliances, rad/(N m); a specimen has other ones.
    softness : float
        Ratio of the compliances to those of a heavy arm, at least 1.
    limits : (n, 2) array
        Joint limits, rad.
    masses : tuple of LinkMass
        As declared.
    gravity_m_s2 : tuple
        In the axes of the base.
    payload_kg : float
        Rated load.
    load_share : float
        Ratio of the payload to that of a heavy arm, at most 1.
    compensated : bool
        Whether a gravity compensator acts at the shoulder.
    gear_ratio : tuple
        Turns of the motor per turn of the joint.
    """

    links: tuple[Link, ...]
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
        return tuple(name for link in self.links for name in link.points)


def read_arm(path: str | Path) -> Arm:
    """Read a robot file that the analysis can read too."""
    text = Path(path).read_text(encoding="utf-8")
    return build_arm(yaml.safe_load(text), Path(path).as_posix())


def build_arm(document: Mapping[str, Any], source: str = "robot") -> Arm:
    """Build an arm from the contents of a robot file.

    Parameters
    ----------
    document
        Contents of the file.
    source
        Name of the file for errors.

    Raises
    ------
    InputError
        If a drive is prismatic or appears twice, or if the controller displays other
        angles than those of the joints.
    """
    if "reported_joints" in document:
        raise InputError(
            source,
            "reported_joints",
            "other angles than the joints'",
            "none, of a robot that is simulated",
        )
    links, axes = _parse_links(document["chain"], document.get("lengths_m", {}), source)
    joints = len(axes)
    lengths = np.array([np.linalg.norm(link.vector_m) for link in links])
    reach = float(sum(lengths[1:]))
    # Arms of 1 to 3 m carry 8 kg m^-3 times the cube of their reach.
    payload = document.get("payload_kg", 8.0 * reach**3)
    if "compliance_urad_per_Nm" in document:
        compliance = 1e-6 * np.array(document["compliance_urad_per_Nm"], float)
    else:
        levers = np.cumsum(lengths[:0:-1])[::-1]
        compliance = _WIND_UP_RAD / (
            standard_gravity
            * max(payload, _MIN_PAYLOAD_KG)
            * np.maximum(levers, _MIN_LEVER_M)
        )
    declared_masses = [
        LinkMass(**entry | {"centre_m": tuple(map(float, entry["centre_m"]))})
        for entry in document.get("masses", ())
    ]
    limits_deg = document.get("joint_limits_deg", [[-360.0, 360.0]] * joints)
    typical_ratios = np.resize(_TYPICAL_GEAR_RATIOS, joints).tolist()
    return Arm(
        links=links,
        lengths_m=lengths,
        reach_m=reach,
        axes=axes,
        compliance=compliance,
        softness=max(1.0, float(np.median(compliance)) / _HEAVY_COMPLIANCE_RAD_PER_NM),
        limits=np.radians(np.array(limits_deg, float)),
        masses=tuple(declared_masses or _estimate_masses(links, payload, reach)),
        gravity_m_s2=tuple(
            map(float, document.get("gravity_m_s2", (0.0, 0.0, -standard_gravity)))
        ),
        payload_kg=payload,
        load_share=min(1.0, payload / _HEAVY_PAYLOAD_KG),
        # A file that declares no masses does not declare its compensator either.
        compensated="compensator" in document or not declared_masses,
        gear_ratio=tuple(document.get("gear_ratio", typical_ratios)),
    )


def _estimate_masses(
    links: tuple[Link, ...], payload: float, reach: float
) -> list[LinkMass]:
    """Masses of the links of an arm whose file declares none."""
    falling = _LINK_MASS_RATIO ** np.arange(len(links) - 2)
    link_shares = (1.0 - _FOOT_SHARE - _CAROUSEL_SHARE) * falling / falling.sum()
    total = _MASS_SCALE_KG * (payload * reach) ** _MASS_EXPONENT
    aside = np.array([0.0, _CENTRE_ASIDE * reach, 0.0])
    masses = []
    for number, share in enumerate([_FOOT_SHARE, _CAROUSEL_SHARE, *link_shares]):
        # To the millimetre and to 100 g, as somebody would declare them.
        centre = np.round(_CENTRE_ALONG * links[number].vector_m + aside, 3)
        masses.append(
            LinkMass(number, round(float(share * total), 1), tuple(centre.tolist()))
        )
    return masses


def _parse_links(
    chain: str, lengths: Mapping[str, float], source: str
) -> tuple[tuple[Link, ...], np.ndarray]:
    """Cut a chain at its drives into links; return these and the axes (n, 3)."""
    links: list[Link] = []
    axes: list[np.ndarray] = []
    position = np.zeros(3)
    rotation = np.eye(3)
    points = {}
    for kind, axis, minus, argument, point in _CHAIN_TERM.findall(chain):
        if point:
            points[point] = position, rotation
            continue
        direction = (-1.0 if minus else 1.0) * np.eye(3)["xyz".index(axis)]
        if re.fullmatch(r"q\d+", argument):
            expected = f"q{len(axes) + 1}"
            if (kind, argument) != ("R", expected):
                raise InputError(
                    source,
                    "chain",
                    f"{kind}{axis}({minus}{argument})",
                    f"drives that turn, each in one place: R.({expected})",
                )
            links.append(Link(position, rotation, points))
            axes.append(direction)
            position = np.zeros(3)
            rotation = np.eye(3)
            points = {}
        elif kind == "T":
            length = float(lengths.get(argument, argument))
            position = position + rotation @ (length * direction)
        else:
            angle = np.radians(float(argument.removesuffix("deg")))
            rotation = rotation @ to_rotation_matrix(angle * direction)
    return (*links, Link(position, rotation, points)), np.array(axes)


def to_rotation_matrix(vector: ArrayLike) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad."""
    return Rotation.from_rotvec(np.array(vector, float)).as_matrix()


def to_rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Rotation vectors (..., 3), rad, of rotation matrices (..., 3, 3).

    Angles go up to a half turn, which is included.
    """
    # A product of two rotations is a rotation up to rounding, so scipy need not
    # orthogonalise it.
    return Rotation.from_matrix(np.array(rotation), assume_valid=True).as_rotvec()


def draw_true_masses(
    arm: Arm,
    draws: np.random.Generator,
    max_offset_m: float,
    offset_draws: np.random.Generator,
) -> tuple[LinkMass, ...]:
    """Draw masses and centres of one specimen around the declared ones.

    Parameters
    ----------
    arm
        Declares masses and their standard deviations.
    draws, offset_draws
        Random numbers of the declared uncertainty and of the undeclared offsets.
    max_offset_m
        Largest undeclared offset of a centre from the line of its link, in each
        direction across the line.
    """
    masses = []
    for mass in arm.masses:
        mass_deviation, *centre_deviation = np.clip(
            draws.standard_normal(4), -_MAX_DEVIATION, _MAX_DEVIATION
        )
        centre = np.array(mass.centre_m) + mass.centre_std_m() * np.array(
            centre_deviation
        )
        if max_offset_m:
            offset = offset_draws.uniform(-max_offset_m, max_offset_m, 3)
            vector = arm.links[mass.link].vector_m
            axis = vector / max(float(np.linalg.norm(vector)), 1e-300)
            centre = centre + offset - (offset @ axis) * axis
        masses.append(
            replace(
                mass,
                mass_kg=mass.mass_kg * (1.0 + mass.relative_std * mass_deviation),
                centre_m=tuple(centre),
            )
        )
    return tuple(masses)
