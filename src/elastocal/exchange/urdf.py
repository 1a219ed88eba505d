"""A URDF file, read safely, and the serial chain between two of its links as the
contents of a robot file.

The Unified Robot Description Format (wiki.ros.org/urdf/XML) is XML. Document types are
refused, and with them entities that grow without end or fetch another file; no other
file is opened.

A joint is a fixed transform (``origin``), which becomes ``Tx Ty Tz Rz Ry Rx``, followed by
a motion about or along an axis. An axis other than x, y or z is rotated into z and back.
Everything that a joint carries rigidly becomes one mass, including side branches and the
links behind the tip.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import takewhile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from elastocal.counting import list_first
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.robot_text import (
    ImportedRobot,
    check_imported,
    express_axis,
    format_displacement,
    format_point_name,
    make_origin_transform,
    make_transform,
)
from elastocal.io.texts import LARGEST_NUMBER, parse_number, read_bytes
from elastocal.mechanics.robot import STANDARD_GRAVITY, UNLIMITED_DEG

# Upper bound on the size of a file. The longest public descriptions, of humanoids with
# hands, have less than a megabyte.
LARGEST_BYTES = 20_000_000
# Upper bounds on the number of elements and on their nesting. In memory an element takes
# many times its size in the file.
_MOST_ELEMENTS = 200_000
_DEEPEST = 50
# Upper bound on links and on joints. Whole cells with grippers and cameras have some
# hundred links, and each is followed up to the root.
_MOST_PARTS = 2000
_MOVING = {"revolute": "R", "continuous": "R", "prismatic": "T"}
_KINDS = (*_MOVING, "fixed", "floating", "planar")
_XACRO = "a URDF; this is xacro, run it first: xacro FILE > robot.urdf"
# Attributes with numbers, by element and name: how many numbers, and the default text.
_NUMBERS = {
    ("origin", "xyz"): (3, "0 0 0"),
    ("origin", "rpy"): (3, "0 0 0"),
    ("axis", "xyz"): (3, "1 0 0"),
    ("limit", "lower"): (1, "0"),
    ("limit", "upper"): (1, "0"),
    ("mass", "value"): (1, ""),
    ("mimic", "multiplier"): (1, "1"),
    ("mimic", "offset"): (1, "0"),
}
# Upper bound on the numbers of a limit: programs write 1e16 and more if a joint has none.
_LARGEST_LIMIT = 1e100
# A shorter axis has a direction that is only rounding error.
_SHORTEST_AXIS = 1e-9
# Decimals in the robot file of limits (deg, m), gravity (m/s²), masses (kg) and their
# centres (m).
_DECIMALS = 9
# Standard deviation of the masses over their values. A URDF does not say whether they were
# guessed, or come from a drawing without cables, grease and covers. Where dynamic
# parameters of robots were identified, masses and centres of such models were off by a
# tenth to a third.
_MASS_STD = 0.2
# Upper bound on a limit in radians: two turns and rounding. Limits in degrees are larger,
# and so are those that programs write if a joint has none.
_FARTHEST_RAD = 4.0 * math.pi + 0.01
# At least this many links of equal mass are placeholders.
_FEWEST_ALIKE = 3
# Number of joints that a note names.
_NAMED = 4


@dataclass(frozen=True)
class Mimic:
    """How a joint follows another one: its value is the multiplier times the other's
    value, plus the offset.

    Attributes
    ----------
    joint : name of the other joint.
    multiplier, offset : rad/rad and rad; m for prismatic joints.
    """

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint of a URDF.

    Attributes
    ----------
    name, kind, parent, child : as the file has them.
    origin : transform (4, 4) from the parent's frame.
    axis : direction (3,) in the joint's own frame.
    lower, upper : limits, rad or m; 0 if they are not stated.
    mimic : how the joint follows another one, None if it does not.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float
    mimic: Mimic | None

    @property
    def has_limits_in_radians(self) -> bool:
        """Whether the limits exist and can be radians."""
        is_stated = self.lower < self.upper
        return is_stated and max(-self.lower, self.upper) <= _FARTHEST_RAD


@dataclass(frozen=True)
class Urdf:
    """A tree of links, with unique names and with every joint between two links.

    Attributes
    ----------
    name : name of the robot.
    moments : by the name of a link, (4,): its mass times its centre in the link's frame
        (kg m), and the mass (kg, 0 if none is stated).
    joints : in the order of the file.
    above : joint that carries a link, by the link's name; the root has none.
    """

    name: str
    moments: dict[str, np.ndarray]
    joints: tuple[Joint, ...]
    above: dict[str, Joint]

    def joints_above(self, link: str) -> Iterator[Joint]:
        """Iterate over the joints that carry a link, from the nearest to the root."""
        while link in self.above:
            yield self.above[link]
            link = self.above[link].parent

    def path_to(self, tip: str, base: str | None) -> list[Joint]:
        """List the joints from `base` to `tip`; from the root of the tree if `base` does
        not carry the tip."""
        path = takewhile(lambda joint: joint.child != base, self.joints_above(tip))
        return [*path][::-1]


@dataclass(frozen=True)
class UrdfCommands:
    """The joints of a URDF that are commanded, because they follow no other.

    Attributes
    ----------
    names : names of m joints, those of the chain first.
    matrix, offset : (n, m) and (n,) arrays, as in `Robot`.
    """

    names: tuple[str, ...]
    matrix: np.ndarray
    offset: np.ndarray


@dataclass(frozen=True)
class UrdfChain:
    """The serial chain between two links.

    Attributes
    ----------
    notation : the chain with its measuring points in the chain notation.
    joints : the joints of q1, q2, ...
    commands : how the values of these follow from those of the joints that are
        commanded
    links : by the name of each link on the chain, the number of the joint that carries
        it, 0 for the column; and its frame (4, 4) in the frame directly behind that
        joint.
    """

    notation: str
    joints: tuple[Joint, ...]
    commands: UrdfCommands
    links: dict[str, tuple[int, np.ndarray]]


def robot_from_urdf(
    path: str | Path, base: str, tip: str, points: Sequence[str] = ()
) -> ImportedRobot:
    """Import the robot between two links of a URDF.

    Parameters
    ----------
    path : URDF file
    base : link whose frame is the robot's base frame
    tip : link whose frame is the last measuring point
    points : links between them that are measuring points too
    """
    urdf = read_urdf(path)
    source = str(path)
    chain = find_chain(urdf, base, tip, points, source)
    masses, mass_notes = _list_masses(urdf, chain)
    joints = ", ".join(
        f"q{number} from {joint.name!r}" for number, joint in enumerate(chain.joints, 1)
    )
    has_followers = any(joint.mimic for joint in chain.joints)
    reading = "read as joints of the chain" if has_followers else "read"
    notes = [f"{reading}: {joints}", *mass_notes]
    document: dict[str, Any] = {
        "name": urdf.name,
        "joint_names": [joint.name for joint in chain.joints],
        "chain": chain.notation,
        "joint_limits_deg": [_convert_limits(joint, source) for joint in chain.joints],
    }
    if has_followers:
        document["reported_joints"] = _describe_commands(chain)
        notes.append(_describe_followers(chain))
    notes += _note_missing_limits(chain.joints)
    # The root of the tree stands upright.
    transform = np.eye(4)
    for joint in urdf.path_to(base, None):
        transform = transform @ joint.origin
    gravity = np.round(-STANDARD_GRAVITY * transform[2, :3], _DECIMALS) + 0.0
    if gravity[2] != -STANDARD_GRAVITY:
        document["gravity_m_s2"] = gravity.tolist()
        notes.append(
            f"gravity as at {base!r} where the root of the tree stands upright and the"
            " joints before it are at zero"
        )
    if masses:
        document["masses"] = masses
        notes.append(
            f"masses are known to {100 * _MASS_STD:g} %, by assumption: a URDF does not"
            " say"
        )
    omitted = [
        joint.name
        for joint in urdf.joints
        if joint.kind != "fixed" and joint.child not in chain.links
    ]
    if omitted:
        notes.append(
            f"joints that are no part of the chain, left out: {', '.join(omitted)}"
        )
    return check_imported(document, path, f"the links from {base!r} to {tip!r}", notes)


def _note_missing_limits(joints: Sequence[Joint]) -> list[str]:
    """Note joints that turn without limits in radians."""
    notes = []
    for joint in joints:
        if joint.kind == "revolute" and not joint.has_limits_in_radians:
            limits = "no limits in the URDF"
            if joint.lower < joint.upper:
                limits = f"limits of {joint.lower:g} to {joint.upper:g}, no radians"
            notes.append(f"joint {joint.name!r} has {limits}: a turn either way")
    return notes


def _describe_commands(chain: UrdfChain) -> dict[str, Any]:
    """Describe the commanded joints as ``reported_joints`` of a robot file."""
    offset = [
        value if joint.kind == "prismatic" else math.degrees(value)
        for joint, value in zip(chain.joints, chain.commands.offset, strict=True)
    ]
    return {
        "matrix": chain.commands.matrix.tolist(),
        "offset_deg": [float(value) for value in offset],
        "names": list(chain.commands.names),
    }


def _describe_followers(chain: UrdfChain) -> str:
    """Say which joints are not commanded, and what the reported angles are."""
    followers = [
        f"{joint.name!r} follows {joint.mimic.joint!r}"
        for joint in chain.joints
        if joint.mimic is not None
    ]
    commands = ", ".join(
        f"q{number} of {name!r}" for number, name in enumerate(chain.commands.names, 1)
    )
    return f"{list_first(followers, _NAMED)}; measurements have the angles {commands}"


def _convert_limits(joint: Joint, source: str) -> list[float]:
    """Convert limits to degrees, or to metres if the joint is prismatic.

    A revolute joint without limits in radians gets one turn either way.
    """
    limits = [joint.lower, joint.upper]
    if joint.kind != "prismatic":
        if not joint.has_limits_in_radians:
            return list(UNLIMITED_DEG)
        limits = [math.degrees(limit) for limit in limits]
    elif joint.lower >= joint.upper:
        raise InputError(
            source,
            f"joint {joint.name!r}: limit",
            f"{joint.lower:g} to {joint.upper:g}",
            'of a prismatic joint, <limit lower="..." upper="..."> in metres',
        )
    return [round(limit, _DECIMALS) for limit in limits]


def read_urdf(path: str | Path) -> Urdf:
    """Read links, joints and masses of a URDF file.

    Raises `InputError` if its links and joints do not form a tree, or if a number cannot
    be read.
    """
    source = Path(path).as_posix()
    root = _parse(read_bytes(path, LARGEST_BYTES, "a URDF file"), source)
    links = root.findall("link")
    _check_tree(links, root.findall("joint"), source)
    moments = {link.attrib["name"]: _read_moment(link, source) for link in links}
    joints = tuple(_read_joint(element, source) for element in root.findall("joint"))
    name = root.get("name") or Path(path).stem
    return Urdf(name, moments, joints, {joint.child: joint for joint in joints})


def _read_moment(link: Element, source: str) -> np.ndarray:
    """Read the first moment (kg m) and the mass (kg) of a link, ndarray (4,)."""
    inertial = link.find("inertial")
    if inertial is None:
        return np.zeros(4)
    key = f"link {link.attrib['name']!r}"
    centre = _read_numbers(inertial, "origin", "xyz", key, source)
    mass = 0.0
    if inertial.find("mass") is not None:
        (mass,) = _read_numbers(inertial, "mass", "value", key, source)
    if mass < 0:
        raise InputError(source, f"{key}: mass value", f"{mass:g}", "0 or more kg")
    return mass * np.array([*centre, 1.0])


def _read_joint(element: Element, source: str) -> Joint:
    name = element.attrib["name"]

    def numbers(tag: str, attribute: str) -> list[float]:
        return _read_numbers(element, tag, attribute, f"joint {name!r}", source)

    origin = make_origin_transform(numbers("origin", "xyz"), numbers("origin", "rpy"))
    (lower,) = numbers("limit", "lower")
    (upper,) = numbers("limit", "upper")
    return Joint(
        name,
        element.attrib["type"],
        _get_end(element, "parent"),
        _get_end(element, "child"),
        origin,
        np.array(numbers("axis", "xyz")),
        lower,
        upper,
        _read_mimic(element, source),
    )


def _read_mimic(element: Element, source: str) -> Mimic | None:
    """Read how a joint follows another one. A fixed joint follows none."""
    mimic = element.find("mimic")
    if mimic is None or element.attrib["type"] == "fixed":
        return None
    key = f"joint {element.attrib['name']!r}"
    (multiplier,) = _read_numbers(element, "mimic", "multiplier", key, source)
    (offset,) = _read_numbers(element, "mimic", "offset", key, source)
    return Mimic(mimic.get("joint", ""), multiplier, offset)


def _read_numbers(
    element: Element, tag: str, attribute: str, key: str, source: str
) -> list[float]:
    """Read the numbers of an attribute of a child, or its default; `key` names the
    element in errors."""
    count, default = _NUMBERS[tag, attribute]
    child = element.find(tag)
    text = default if child is None else child.get(attribute, default)
    largest = _LARGEST_LIMIT if tag == "limit" else LARGEST_NUMBER
    values = [parse_number(number, largest) for number in text.split(None, count)]
    numbers = [value for value in values if value is not None]
    if not len(values) == len(numbers) == count:
        kind = "a number" if count == 1 else f"{count} numbers"
        raise InputError(
            source,
            f"{key}: {tag} {attribute}",
            repr(text),
            f"{kind}, up to {largest:g} in size",
        )
    return numbers


def _get_end(joint: Element, tag: str) -> str:
    """Name of the parent or the child of a joint, "" if there is none."""
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree of elements without namespaces.

    It refuses document types, trees that grow without end, and xacro.
    """

    def __init__(self, source: str) -> None:
        super().__init__()
        self.source = source
        self.count = 0
        self.depth = 0

    def doctype(self, *_: object) -> None:
        raise InputError(
            self.source,
            "",
            "<!DOCTYPE",
            (
                "a URDF without a document type, whose entities could be endless or other"
                " files"
            ),
        )

    def start(self, tag: str, attrs: dict[str, str]) -> Element:
        uri, _, name = tag.rpartition("}")
        self.count += 1
        self.depth += 1
        self._refuse_more_than(self.depth, _DEEPEST, "elements in each other")
        self._refuse_more_than(self.count, _MOST_ELEMENTS, "elements")
        if "xacro" in uri:
            raise InputError(self.source, "", f"<xacro:{name}>", _XACRO)
        for value in attrs.values():
            if "${" in value or "$(" in value:
                raise InputError(self.source, f"<{name}>", repr(value), _XACRO)
        return super().start(name, attrs)

    def _refuse_more_than(self, count: int, most: int, noun: str) -> None:
        if count > most:
            raise InputError(
                self.source, "", f"more than {most} {noun}", "a URDF, which needs fewer"
            )

    def end(self, tag: str) -> Element:
        self.depth -= 1
        return super().end(tag.rpartition("}")[2])


def _parse(data: bytes, source: str) -> Element:
    """Parse the bytes of a file, and return the element of the robot."""
    parser = ElementTree.XMLParser(target=_Builder(source))
    try:
        root = ElementTree.fromstring(data, parser)
    except ElementTree.ParseError as error:
        raise InputError(
            source,
            f"line {error.position[0]}",
            str(error).partition(":")[0],
            "a URDF, which is XML",
        ) from None
    except InputError:
        raise
    except (ValueError, LookupError) as error:
        raise InputError(source, "", str(error), "a URDF, which is XML") from None
    if root.tag != "robot":
        raise InputError(source, "", f"<{root.tag}>", "a URDF, which is a <robot>")
    return root


def _check_tree(
    links: Sequence[Element], joints: Sequence[Element], source: str
) -> None:
    """Refuse links and joints that do not form a tree."""
    _check_names("link", links, source)
    _check_names("joint", joints, source)
    link_names = {link.attrib["name"] for link in links}
    parents: dict[str, str] = {}
    for joint in joints:
        key = f"joint {joint.attrib['name']!r}"
        joint_type = joint.get("type")
        if joint_type not in _KINDS:
            raise InputError(source, key, f"type {joint_type!r}", " | ".join(_KINDS))
        ends = {tag: _get_end(joint, tag) for tag in ("parent", "child")}
        for tag, link in ends.items():
            if link not in link_names:
                raise InputError(source, key, f"{tag} {link!r}", "a link of this file")
        child = ends["child"]
        if child in parents:
            raise InputError(
                source,
                key,
                f"child {child!r}, which another joint has too",
                "a tree: each link below one joint",
            )
        parents[child] = ends["parent"]
    try:
        TopologicalSorter(
            {child: [parent] for child, parent in parents.items()}
        ).prepare()
    except CycleError as error:
        raise InputError(
            source,
            f"link {error.args[1][0]!r}",
            "a loop of joints",
            "a tree: no link below itself",
        ) from None


def _check_names(tag: str, elements: Sequence[Element], source: str) -> None:
    """Refuse no elements, too many, and names that are missing or used twice."""
    if not 0 < len(elements) <= _MOST_PARTS:
        raise InputError(
            source,
            "",
            f"{len(elements)} times <{tag}>" if elements else f"no <{tag}>",
            f"a URDF with links and joints, at most {_MOST_PARTS}",
        )
    counts = Counter(element.get("name", "") for element in elements)
    for name, count in counts.items():
        if count > 1 or not name:
            raise InputError(
                source,
                f"{tag} {name!r}",
                f"{count} times",
                "a name for each, and each name once",
            )


def find_chain(
    urdf: Urdf, base: str, tip: str, points: Sequence[str], source: str
) -> UrdfChain:
    """Find the chain from one link, `base`, to another that it carries, `tip`.

    The tip and `points`, which are links between the two, are measuring points.

    Raises
    ------
    InputError
        There is no such chain, or one of its joints cannot be part of a robot file.
    """
    path = _find_path(urdf, base, tip, source)
    on_chain = [base, *(joint.child for joint in path)]
    for name in points:
        if name not in on_chain:
            names = suggest_names(name, on_chain)
            raise InputError(
                source,
                "point",
                repr(name),
                f"a link between {base!r} and {tip!r}: {names}",
            )
    marks = {name: f"[{format_point_name(name)}]" for name in (*points, tip)}
    if len(set(marks.values())) < len(marks):
        raise InputError(
            source,
            "point",
            ", ".join(map(repr, marks)),
            "links whose names differ by more than blanks and brackets",
        )
    tokens = [marks.get(base, "")]
    moving: list[Joint] = []
    frame = np.eye(4)
    links = {base: (0, frame)}
    for joint in path:
        tokens += format_displacement(joint.origin)
        frame = frame @ joint.origin
        if joint.kind in _MOVING:
            moving.append(joint)
            axis = express_axis(joint.axis)
            coordinate = f"{axis.sign}q{len(moving)}"
            motion = f"{_MOVING[joint.kind]}{axis.letter}({coordinate})"
            tokens += [*axis.before, motion, *axis.after]
            frame = make_transform(axis.rotation.T)
        tokens.append(marks.get(joint.child, ""))
        links[joint.child] = (len(moving), frame)
    notation = " ".join(filter(None, tokens))
    return UrdfChain(
        notation, tuple(moving), _find_commands(urdf, moving, source), links
    )


def _find_commands(urdf: Urdf, joints: Sequence[Joint], source: str) -> UrdfCommands:
    """Find the joints that are commanded, and how `joints` of a chain follow them."""
    leaders = [_follow_mimics(urdf, joint, source) for joint in joints]
    own = [joint.name for joint in joints if joint.mimic is None]
    names = tuple(dict.fromkeys([*own, *(leader.joint for leader in leaders)]))
    matrix = np.zeros((len(joints), len(names)))
    for row, leader in enumerate(leaders):
        matrix[row, names.index(leader.joint)] = leader.multiplier
    return UrdfCommands(names, matrix, np.array([leader.offset for leader in leaders]))


def _follow_mimics(urdf: Urdf, joint: Joint, source: str) -> Mimic:
    """Find the commanded joint that a joint follows, by way of others if need be; a
    joint that follows none is its own."""
    by_name = {joint.name: joint for joint in urdf.joints}
    leader = Mimic(joint.name, 1.0, 0.0)
    followed = {joint.name}
    while (mimic := by_name[leader.joint].mimic) is not None:
        key = f"joint {leader.joint!r}: mimic"
        target = by_name.get(mimic.joint)
        if target is None or target.kind not in _MOVING:
            allowed = f"a joint of this file that moves: {suggest_names(mimic.joint, [*by_name])}"
            raise InputError(source, key, repr(mimic.joint), allowed)
        if mimic.joint in followed:
            raise InputError(source, key, "joints that follow each other", "no loop")
        if mimic.multiplier == 0.0:
            allowed = "another number; a joint that does not move is fixed"
            raise InputError(source, f"{key} multiplier", "0", allowed)
        followed.add(mimic.joint)
        leader = Mimic(
            mimic.joint,
            leader.multiplier * mimic.multiplier,
            leader.multiplier * mimic.offset + leader.offset,
        )
    return leader


def _find_path(urdf: Urdf, base: str, tip: str, source: str) -> list[Joint]:
    """Find the joints from one link to another; refuse those that do not make a
    chain."""
    for key, name in (("base", base), ("tip", tip)):
        if name not in urdf.moments:
            raise InputError(
                source,
                key,
                repr(name),
                f"a link: {suggest_names(name, [*urdf.moments])}",
            )
    key = f"base {base!r}, tip {tip!r}"
    path = urdf.path_to(tip, base)
    if base != (path[0].parent if path else tip):
        problem = "two branches of the tree"
        if any(joint.parent == tip for joint in urdf.joints_above(base)):
            problem = "a base that the tip carries (give them the other way round)"
        raise InputError(source, key, problem, "a tip that the base carries")
    if not any(joint.kind in _MOVING for joint in path):
        raise InputError(
            source, key, "no joint that moves between them", "links with joints between"
        )
    for joint in path:
        _check_joint(joint, source)
    return path


def _check_joint(joint: Joint, source: str) -> None:
    """Refuse a joint that cannot be part of a serial chain."""
    key = f"joint {joint.name!r}"
    kinds = (*_MOVING, "fixed")
    if joint.kind not in kinds:
        allowed = (
            f"{' | '.join(kinds)}; parallel links are written in the robot file, see"
            " docs/campaign.md"
        )
        raise InputError(source, key, f"type {joint.kind}", allowed)
    if joint.kind in _MOVING and not np.linalg.norm(joint.axis) > _SHORTEST_AXIS:
        axis = " ".join(f"{component:g}" for component in joint.axis)
        raise InputError(source, f"{key}: axis xyz", axis, "a direction")


def _list_masses(
    urdf: Urdf, chain: UrdfChain
) -> tuple[list[dict[str, Any]], list[str]]:
    """List the entries of ``masses`` of a robot file, see `mechanics.robot_file`, and
    notes about them."""
    moments, joints_at_zero = _carried_moments(urdf, chain)
    masses = {float(moment[3]) for moment in moments.values()}
    if len(moments) >= _FEWEST_ALIKE and len(masses) == 1:
        note = (
            f"every link weighs {masses.pop():g} kg: placeholders, which are left out"
        )
        return [], [note]
    notes = []
    if joints_at_zero:
        names = list_first(sorted(joints_at_zero), _NAMED)
        notes.append(
            f"joints beside the chain are held at zero for what they carry: {names}"
        )
    if not moments:
        notes.append("no masses: the weight of the links is not known")
    entries: list[dict[str, Any]] = []
    for link, (*mass_times_centre, mass) in sorted(moments.items()):
        centre = np.round(np.array(mass_times_centre) / mass, _DECIMALS) + 0.0
        entries.append(
            {
                "link": link,
                "mass_kg": round(float(mass), _DECIMALS),
                "centre_m": centre.tolist(),
                "relative_std": _MASS_STD,
            }
        )
    return entries, notes


def _carried_moments(
    urdf: Urdf, chain: UrdfChain
) -> tuple[dict[int, np.ndarray], set[str]]:
    """Sum the first moments and masses that each link of the chain carries.

    Returns
    -------
    moments : ndarrays (4,) by the number of the link: mass times centre, kg m, and
        mass, kg, in the link's frame.
    joints_at_zero : joints beside the chain that move what they carry.
    """
    moments: dict[int, np.ndarray] = {}
    joints_at_zero: set[str] = set()
    for name, moment in urdf.moments.items():
        # Joints from this link up to the link of the chain that carries it.
        path = list(
            takewhile(
                lambda joint: joint.child not in chain.links, urdf.joints_above(name)
            )
        )
        carrier = chain.links.get(path[-1].parent if path else name)
        if not moment[3] or carrier is None:
            continue
        link, transform = carrier
        moving = [joint.name for joint in path if joint.kind != "fixed"]
        # A branch that moves on the column loads no joint of the chain.
        if link == 0 and moving:
            continue
        joints_at_zero.update(moving)
        for joint in path:
            moment = joint.origin @ moment
        moments[link] = moments.get(link, np.zeros(4)) + transform @ moment
    return moments, joints_at_zero
