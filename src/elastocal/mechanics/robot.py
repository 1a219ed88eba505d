"""A robot: a chain of elementary transforms with named measuring points, and what is known of its elasticity.

The chain notation is the paper's matrix product written in a line (equations 1-4)::

    Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [2DoF] Ry(q3) ...

``T`` and ``R`` are a translation along and a rotation about x, y or z of the moving frame; the argument is the name of a
length, a joint ``q1 .. qn``, or a number (metres in ``T``, ``deg`` in ``R``), each with an optional minus sign;
``[NAME]`` marks a measuring point. ``T.(q3)`` is a prismatic joint: its coordinate is in metres, and so are its limits and its
offset; its compliance is in µm/N. A joint that stands in several places, such as ``Ry(q2) Tz(l) Ry(-q2)``, moves all of them:
what a parallelogram or another coupling does. It is where it stands first; behind a later place a passive joint turns.

A robot file may say what the links weigh::

    masses:
      - {link: 2, mass_kg: 190, centre_m: [0.52, 0.0, 0.03], relative_std: 0.1}
    gravity_m_s2: [0, 0, -9.80665]
    gear_ratio: [null, 171, 153, null, null, null]
    compensator: {joint: 2, kind: spring}
    payload_kg: 165

Link k is what joint k carries; link 0 is the column before joint 1. ``centre_m`` is stated in the frame of the chain directly
behind the transform ``R.(qk)`` (of link 0: in the base frame): its origin lies on the axis of joint k, where the chain has it,
and its axes turn with the joint, so that one axis is the joint's own. With all of the chain at zero these are base axes unless
the chain has fixed rotations before. ``relative_std`` is the standard deviation of the mass over the mass, and of each
component of the centre over its distance from the origin (0.1 m at least). Gravity is given in base axes: a robot on a wall or
on a tilted foot has another.
"""

import math
import re
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from elastocal.errors import InputError

AXES = "xyz"
# The longest serial arms of the market reach 4.7 m and their lengths, the column's included, sum to 7; any of them written in
# centimetres, inches or millimetres is beyond this.
LONGEST_REACH_M = 10.0
_TOKEN = re.compile(r"(?P<kind>[TR])(?P<axis>[xyz])\((?P<sign>-?)(?P<argument>[^()\s-]+)\)|\[(?P<point>[^\[\]\s]+)\]")
_NUMBER = re.compile(r"\d+(\.\d*)?|\.\d+")
# Standard acceleration (ISO 80000-3), on a floor.
STANDARD_GRAVITY = 9.80665
STANDING = (0.0, 0.0, -STANDARD_GRAVITY)
_NOTATION = "Tx(length) Ty(..) Tz(..) Rx(joint) Ry(..) Rz(..) Rx(90deg) and [POINT], separated by blanks"


@dataclass(frozen=True)
class Transform:
    """One elementary transform along or about an axis of the moving frame, fixed or moved by a coordinate.

    Attributes
    ----------
    kind : {"T", "R"}
        Translation (m) or rotation (rad).
    axis : int
        0, 1, 2 for x, y, z.
    constant : float
        How far, where it is fixed (m or rad).
    coordinate : int or None
        Index of the coordinate that says how far, where it moves: a joint, or a spring of the extended model.
    sign : float
        Sense of the coordinate, +1 or -1.
    """

    kind: str
    axis: int
    constant: float = 0.0
    coordinate: int | None = None
    sign: float = 1.0


@dataclass(frozen=True)
class MeasuringPoint:
    """A place on the chain where a target sits.

    Attributes
    ----------
    name : str
    after : int
        How many transforms of the chain come before it.
    offset_m : tuple of float
        The target in the frame of the point (the paper's T_tool, without rotation).
    """

    name: str
    after: int
    offset_m: tuple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Chain:
    """Elementary transforms from the base to the last measuring point.

    Attributes
    ----------
    transforms : tuple of Transform
    points : tuple of MeasuringPoint
        In the order of the chain; the last one is the end-effector.
    coordinates : int
        Number of coordinates that the transforms refer to.
    """

    transforms: tuple
    points: tuple
    coordinates: int

    @property
    def end_effector(self):
        """The last measuring point, where the external wrench is stated."""
        return self.points[-1]

    def point(self, name):
        """The measuring point called `name`; KeyError names those there are."""
        for point in self.points:
            if point.name == name:
                return point
        raise KeyError(f"measuring point {name!r}; the chain has {', '.join(p.name for p in self.points)}")

    def moved_by(self, point):
        """Indices of the coordinates before `point`, each once: those that can move it."""
        transforms = self.transforms[: point.after]
        return tuple(dict.fromkeys(t.coordinate for t in transforms if t.coordinate is not None))

    @property
    def prismatic(self):
        """Whether each coordinate is a shift and not a turn, tuple of bool."""
        kinds = {t.coordinate: t.kind == "T" for t in self.transforms if t.coordinate is not None}
        return tuple(kinds.get(coordinate, False) for coordinate in range(self.coordinates))

    def is_passive(self, place):
        """Whether the transform at a place is moved by a coordinate that moves one before it as well."""
        coordinate = self.transforms[place].coordinate
        return coordinate is not None and any(t.coordinate == coordinate for t in self.transforms[:place])


@dataclass(frozen=True)
class Tube:
    """A thick-walled tube of one material.

    Attributes
    ----------
    outer_diameter_m, wall_m : float
        Outer diameter and wall thickness.
    youngs_modulus_Pa, shear_modulus_Pa : float
        Material.
    """

    outer_diameter_m: float
    wall_m: float
    youngs_modulus_Pa: float
    shear_modulus_Pa: float


@dataclass(frozen=True)
class Link:
    """A rigid stretch of the chain between two joints, and the tube that it is taken for.

    Attributes
    ----------
    after : int
        How many transforms of the chain come before its far end.
    vector_m : tuple of float
        From its near to its far end, in the frame of the chain there.
    tube : Tube
    """

    after: int
    vector_m: tuple
    tube: Tube


@dataclass(frozen=True)
class Mass:
    """What a link weighs, as its file declares it.

    Attributes
    ----------
    link : int
        Carried by this joint; 0 for the column.
    mass_kg : float
    centre_m : tuple of float
        Centre of mass in the frame directly behind the joint, see the module's docstring.
    relative_std : float
        How well this is known: of the mass, and of each component of the centre.
    """

    link: int
    mass_kg: float
    centre_m: tuple
    relative_std: float


@dataclass(frozen=True)
class Compensator:
    """A gravity compensator beside a joint.

    Attributes
    ----------
    joint : int
        From 1.
    kind : {"spring", "gas"}
    """

    joint: int
    kind: str


@dataclass(frozen=True)
class Robot:
    """A robot as its file describes it, in SI units.

    Attributes
    ----------
    name : str
    chain : Chain
    compliance : ndarray (n,)
        Joint compliances, rad/(N m); of prismatic joints m/N.
    joint_limits : ndarray (n, 2)
        rad; of prismatic joints m.
    links : tuple of Link
        Elastic links of the extended model; empty for the reduced model.
    reported_matrix, reported_offset : ndarray (n, n), (n,)
        Joint angles from what the controller reports: q = matrix @ reported + offset (rad).
    masses : tuple of Mass
        In the order of the links; empty where nothing is known.
    gravity_m_s2 : tuple of float
        Base axes.
    gear_ratio : tuple of float or None
        Turns of the motor for one of the joint, None for joints where it is not known; None where no joint's is.
    compensator : Compensator or None
    payload_kg : float or None
        Rated.
    """

    name: str
    chain: Chain
    compliance: np.ndarray
    joint_limits: np.ndarray
    links: tuple
    reported_matrix: np.ndarray
    reported_offset: np.ndarray
    masses: tuple = ()
    gravity_m_s2: tuple = STANDING
    gear_ratio: tuple | None = None
    compensator: Compensator | None = None
    payload_kg: float | None = None

    @property
    def joints(self):
        """Number of joints."""
        return self.chain.coordinates

    def model_angles(self, reported):
        """The chain's joint angles from those that the controller reports.

        Parameters
        ----------
        reported : ndarray (..., n)
            rad.

        Returns
        -------
        ndarray (..., n)
        """
        return reported @ self.reported_matrix.T + self.reported_offset

    def reported_angles(self, angles):
        """Joint angles as the controller reports them from the chain's.

        Parameters
        ----------
        angles : ndarray (N, n)
            rad.

        Returns
        -------
        ndarray (N, n)
        """
        return np.linalg.solve(self.reported_matrix, (angles - self.reported_offset).T).T


def parse_chain(text, lengths_m, source):
    """Read the chain notation.

    Parameters
    ----------
    text : str
        The chain, as in the module's docstring.
    lengths_m : mapping of str to float
        Named lengths.
    source : str
        Named in errors.

    Returns
    -------
    Chain

    Raises
    ------
    InputError
        A token outside the notation, an unknown or unused length, joints that are not q1..qn in order, a joint that turns in
        one place and shifts in another, no measuring point, a measuring point named twice.
    """
    transforms, points, used, kinds = [], [], set(), {}
    for word in text.split():
        token = _TOKEN.fullmatch(word)
        if not token:
            raise InputError(source, "chain", repr(word), _NOTATION)
        if token["point"]:
            if token["point"] in {p.name for p in points}:
                raise InputError(source, "chain", f"[{token['point']}] twice", "each measuring point once")
            points.append(MeasuringPoint(token["point"], len(transforms)))
            continue
        kind, axis, argument = token["kind"], AXES.index(token["axis"]), token["argument"]
        sign = -1.0 if token["sign"] else 1.0
        number = argument.removesuffix("deg") if kind == "R" else argument
        if kind == "T" and argument in lengths_m:
            used.add(argument)
            transforms.append(Transform(kind, axis, sign * lengths_m[argument]))
        elif _NUMBER.fullmatch(number) and (kind == "T" or argument.endswith("deg")):
            value = float(number)
            transforms.append(Transform(kind, axis, sign * (value if kind == "T" else math.radians(value))))
        elif argument == f"q{len(kinds) + 1}" or argument in kinds:
            if kinds.setdefault(argument, kind) != kind:
                raise InputError(source, "chain", repr(word), f"{argument} in R.() or in T.() alone")
            transforms.append(Transform(kind, axis, 0.0, int(argument[1:]) - 1, sign))
        else:
            others = "degrees such as 90deg" if kind == "R" else f"{', '.join(lengths_m)} or metres"
            allowed = f"q{len(kinds) + 1}{', a joint before it' if kinds else ''} or {others}"
            raise InputError(source, "chain", repr(word), f"in {kind}{token['axis']}(): {allowed}")
    if not kinds:
        raise InputError(source, "chain", "no joint", "at least one R.(q1) or T.(q1)")
    if not points or points[-1].after != len(transforms):
        raise InputError(source, "chain", f"{text.split()[-1]!r} at its end", "a measuring point such as [6DoF] at the end")
    if unused := sorted(set(lengths_m) - used):
        raise InputError(source, "lengths_m", ", ".join(unused), "lengths that the chain uses")
    return Chain(tuple(transforms), tuple(points), len(kinds))


def with_target_offset(holder, offset_m):
    """A chain, or the robot around it, with the same target offset on every measuring point (the paper's T_tool, reading R5).

    Parameters
    ----------
    holder : Chain or Robot
    offset_m : sequence of float

    Returns
    -------
    Chain or Robot
    """
    if isinstance(holder, Robot):
        return replace(holder, chain=with_target_offset(holder.chain, offset_m))
    return replace(holder, points=tuple(replace(p, offset_m=tuple(offset_m)) for p in holder.points))


def stretches(chain):
    """Rigid stretches between the joints, as (transforms before the far end, vector in the frame of the chain there).

    Rotations by a fixed angle inside a stretch are not supported here, as in any chain that turns at its joints only.
    """
    found, vector = [], np.zeros(3)
    for index, transform in enumerate(chain.transforms):
        if transform.kind == "T":
            vector[transform.axis] += transform.constant
        if transform.kind == "R" or index == len(chain.transforms) - 1:
            end = index if transform.kind == "R" else index + 1
            if np.linalg.norm(vector) > 0:
                found.append((end, tuple(vector.tolist())))
            vector = np.zeros(3)
    return tuple(found)


def joint_limits(limits_deg, chain, source):
    """Joint limits in rad, of prismatic joints in m.

    Parameters
    ----------
    limits_deg : sequence of (float, float)
        Lower and upper limit of each joint; of prismatic ones in metres.
    chain : Chain
        Whose joints they are.
    source : str
        Named in errors.

    Returns
    -------
    ndarray (n, 2)

    Raises
    ------
    InputError
        Where there are too few or too many, or a lower limit is not below the upper one.
    """
    joints = chain.coordinates
    if len(limits_deg) != joints:
        raise InputError(source, "joint_limits_deg", f"{len(limits_deg)} entries", f"one for each of the {joints} joints")
    for joint, (low, high) in enumerate(limits_deg):
        if low >= high:
            raise InputError(source, f"joint_limits_deg[{joint}]", str([low, high]), "[lower, upper]")
    return np.array(limits_deg, float) * _per_degree(chain)[:, None]


def _per_degree(chain):
    """What one degree, or of prismatic joints one metre, of a robot file is in SI units, ndarray (n,)."""
    return np.where(chain.prismatic, 1.0, math.radians(1.0))


def robot_from_document(document, source="robot"):
    """Make a robot from the contents of its file, already validated against the robot schema.

    Parameters
    ----------
    document : mapping
        Keys as in ``schemas/robot.yaml``.
    source : str
        Named in errors.

    Returns
    -------
    Robot

    Raises
    ------
    InputError
        Where the chain does not parse or reaches farther than any machine, or a list has another length than there are joints.
    """
    chain = parse_chain(document["chain"], document.get("lengths_m", {}), source)
    _check_reach(chain, "lengths_m" if document.get("lengths_m") else "chain", source)
    n = chain.coordinates
    if len(document["compliance_urad_per_Nm"]) != n:
        found = f"{len(document['compliance_urad_per_Nm'])} entries"
        raise InputError(source, "compliance_urad_per_Nm", found, f"one for each of the {n} joints")
    reported = document.get("reported_joints", {})
    matrix = reported.get("matrix", np.eye(n).tolist())
    offset = reported.get("offset_deg", [0.0] * n)
    if [len(row) for row in matrix] != [n] * n or len(offset) != n:
        found = f"rows of {[len(row) for row in matrix]} and {len(offset)} offsets"
        raise InputError(source, "reported_joints", found, f"{n} rows of {n} numbers and {n} offsets")
    return Robot(
        name=document["name"],
        chain=chain,
        compliance=1e-6 * np.array(document["compliance_urad_per_Nm"], float),
        joint_limits=joint_limits(document["joint_limits_deg"], chain, source),
        links=_links(chain, document.get("links"), source),
        reported_matrix=np.array(matrix, float),
        reported_offset=np.array(offset, float) * _per_degree(chain),
        masses=_masses(document.get("masses", ()), n, source),
        gravity_m_s2=_gravity(document.get("gravity_m_s2", STANDING), source),
        gear_ratio=_gear_ratio(document.get("gear_ratio"), n, source),
        compensator=_compensator(document.get("compensator"), n, source),
        payload_kg=document.get("payload_kg"),
    )


def document_of(robot):
    """A robot as the contents of its file, the inverse of `robot_from_document`.

    Parameters
    ----------
    robot : Robot
        Without elastic links: their tubes are no data of an arm but of a study.

    Returns
    -------
    dict
        Keys as in ``schemas/robot.yaml``; optional ones only where they say something. Lengths stand in the chain as numbers.
    """
    document = {
        "name": robot.name,
        "chain": notation(robot.chain),
        "joint_limits_deg": (robot.joint_limits / _per_degree(robot.chain)[:, None]).tolist(),
        "compliance_urad_per_Nm": (1e6 * robot.compliance).tolist(),
    }
    if (robot.reported_matrix != np.eye(robot.joints)).any() or robot.reported_offset.any():
        offset = (robot.reported_offset / _per_degree(robot.chain)).tolist()
        document["reported_joints"] = {"matrix": robot.reported_matrix.tolist(), "offset_deg": offset}
    if robot.masses:
        document["masses"] = [vars(mass) | {"centre_m": list(mass.centre_m)} for mass in robot.masses]
    if robot.gravity_m_s2 != STANDING:
        document["gravity_m_s2"] = list(robot.gravity_m_s2)
    if robot.gear_ratio is not None:
        document["gear_ratio"] = list(robot.gear_ratio)
    if robot.compensator is not None:
        document["compensator"] = dict(vars(robot.compensator))
    if robot.payload_kg is not None:
        document["payload_kg"] = robot.payload_kg
    return document


def notation(chain):
    """A chain in the notation that `parse_chain` reads, with its lengths as numbers.

    Parameters
    ----------
    chain : Chain

    Returns
    -------
    str
    """
    words = []
    for place in range(len(chain.transforms) + 1):
        words += [f"[{point.name}]" for point in chain.points if point.after == place]
        if place < len(chain.transforms):
            words.append(_word(chain.transforms[place]))
    return " ".join(words)


def _word(transform):
    turns = transform.kind == "R"
    if transform.coordinate is not None:
        sign, argument = transform.sign, f"q{transform.coordinate + 1}"
    else:
        sign, amount = math.copysign(1.0, transform.constant), abs(transform.constant)
        number = np.format_float_positional(math.degrees(amount) if turns else amount, trim="-")
        argument = f"{number}deg" if turns else number
    return f"{transform.kind}{AXES[transform.axis]}({'-' if sign < 0 else ''}{argument})"


def _masses(described, joints, source):
    masses = sorted((Mass(**entry | {"centre_m": tuple(map(float, entry["centre_m"]))}) for entry in described), key=_link_of)
    for index, entry in enumerate(described):
        if entry["link"] > joints:
            raise InputError(
                source, f"masses[{index}].link", str(entry["link"]), f"0 for the column, or a joint up to {joints}"
            )
    for one, other in pairwise(masses):
        if one.link == other.link:
            raise InputError(source, "masses", f"link {one.link} twice", "each link once, with all that it carries")
    return tuple(masses)


def _link_of(mass):
    return mass.link


def _gravity(vector, source):
    if not any(vector):
        raise InputError(source, "gravity_m_s2", str(list(vector)), "a vector with a length, in base axes")
    return tuple(map(float, vector))


def _gear_ratio(ratios, joints, source):
    if ratios is None:
        return None
    if len(ratios) != joints:
        raise InputError(source, "gear_ratio", f"{len(ratios)} entries", f"one or null for each of the {joints} joints")
    return tuple(ratios)


def _compensator(described, joints, source):
    if described is None:
        return None
    if described["joint"] > joints:
        raise InputError(source, "compensator.joint", str(described["joint"]), f"a joint from 1 to {joints}")
    return Compensator(**described)


def _check_reach(chain, key, source):
    reach = sum(abs(transform.constant) for transform in chain.transforms if transform.kind == "T")
    if reach > LONGEST_REACH_M:
        allowed = f"lengths in metres (not millimetres) that reach {LONGEST_REACH_M:g} m at most"
        raise InputError(source, key, f"a chain that reaches {reach:.4g} m", allowed)


def _links(chain, described, source):
    if described is None:
        return ()
    odd = {
        "fixed rotations": any(t.kind == "R" and t.coordinate is None for t in chain.transforms),
        "prismatic joints": any(chain.prismatic),
        "passive joints": any(chain.is_passive(place) for place in range(len(chain.transforms))),
    }
    for what in (what for what, there in odd.items() if there):
        raise InputError(source, "links", f"a chain with {what}", "links on chains that turn at their joints only")
    rigid = stretches(chain)
    tubes = described["tubes"]
    if len(tubes) not in (1, len(rigid)):
        raise InputError(source, "links.tubes", f"{len(tubes)} tubes", f"one for all links or one for each of the {len(rigid)}")
    links = []
    for number, (after, vector) in enumerate(rigid):
        size = tubes[number if len(tubes) > 1 else 0]
        if 2 * size["wall_m"] > size["outer_diameter_m"]:
            raise InputError(source, "links.tubes", f"wall_m {size['wall_m']}", "at most half the outer_diameter_m")
        tube = Tube(
            size["outer_diameter_m"],
            size["wall_m"],
            1e9 * described["youngs_modulus_GPa"],
            1e9 * described["shear_modulus_GPa"],
        )
        links.append(Link(after, vector, tube))
    return tuple(links)
