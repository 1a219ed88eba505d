"""A URDF file, read safely, and the serial chain between two of its links as the
contents of a robot file.

The Unified Robot Description Format (wiki.ros.org/urdf/XML) is XML. No document type is
accepted, and so no entity that grows or fetches another file; no other file is opened.

A joint is a fixed transform (``origin``), which becomes ``Tx Ty Tz Rz Ry Rx``, and then
a motion about or along an axis; one that is not x, y or z is turned into z and back.
All that a joint carries rigidly is one mass, side branches and what stands behind the
tip included.
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
    Imported,
    check_imported,
    displacement_words,
    express_axis,
    homogeneous,
    origin_transform,
    point_name,
)
from elastocal.io.texts import LARGEST_NUMBER, parse_number, read_bytes
from elastocal.mechanics.robot import STANDARD_GRAVITY, UNLIMITED_DEG

# The longest public descriptions, of humanoids with hands, have less than a megabyte.
LARGEST_BYTES = 20_000_000
# Elements, and how deep in each other: each takes memory many times its size in the
# file.
_MOST_ELEMENTS = 200_000
_DEEPEST = 50
# Whole cells with grippers and cameras have some hundred links; each is followed to the
# root.
_MOST_PARTS = 2000
_MOVING = {"revolute": "R", "continuous": "R", "prismatic": "T"}
_KINDS = (*_MOVING, "fixed", "floating", "planar")
_XACRO = "a URDF; this is xacro, run it first: xacro FILE > robot.urdf"
# How many numbers each attribute has that is read, by its element and name, and what
# they are where nothing states them.
_NUMBERS = {
    ("origin", "xyz"): (3, "0 0 0"),
    ("origin", "rpy"): (3, "0 0 0"),
    ("axis", "xyz"): (3, "1 0 0"),
    ("limit", "lower"): (1, "0"),
    ("limit", "upper"): (1, "0"),
    ("mass", "value"): (1, ""),
}
# Limits to a billionth of a degree, or to a nanometre; gravity to so many m/s²; masses
# to so many kg.
_DECIMALS = 9
# How well masses are known, as a standard deviation over the value. A URDF does not say
# where they come from: of a drawing without cables, grease and covers, or guessed;
# where dynamic parameters of robots were identified, masses and centres of such models
# were off by a tenth to a third.
_MASS_STD = 0.2
# Two turns, and rounding; limits in degrees are farther, and so are those of programs
# where a joint has none.
_FARTHEST_RAD = 4.0 * math.pi + 0.01
# So many links of a robot never weigh the same; links and joints that a note names.
_FEWEST_ALIKE = 3
_NAMED = 4


@dataclass(frozen=True)
class Joint:
    """`origin` (4, 4) is in the parent's frame, `axis` (3,) in its own; limits that are
    not stated are 0."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float
    mimics: bool


@dataclass(frozen=True)
class Urdf:
    """A tree of links: every name once, every joint between two of them.

    `moments` (4,): of each link by its name the mass times its centre in the link's
    frame (kg m), and the mass (kg, 0 where none is stated). `above`: the joint that
    carries a link, by the link's name; the root has none.
    """

    name: str
    moments: dict[str, np.ndarray]
    joints: tuple[Joint, ...]
    above: dict[str, Joint]

    def joints_above(self, link: str) -> Iterator[Joint]:
        """The joints that carry a link, the nearest first, to the root."""
        while link in self.above:
            yield self.above[link]
            link = self.above[link].parent

    def path_to(self, tip: str, base: str | None) -> list[Joint]:
        """The joints from a link, or from the root of the tree where it does not carry
        the tip, to the tip."""
        return [*takewhile(lambda joint: joint.child != base, self.joints_above(tip))][
            ::-1
        ]


@dataclass(frozen=True)
class UrdfChain:
    """The chain between two links: in the notation, with measuring points; the joints
    of q1, q2, ...

    `links`: of each link on it the number of the joint that carries it, 0 for the
    column, and its frame (4, 4) in the one directly behind that joint, all joints at
    zero.
    """

    notation: str
    joints: tuple[Joint, ...]
    links: dict[str, tuple[int, np.ndarray]]


def robot_from_urdf(
    path: str | Path, base: str, tip: str, points: Sequence[str] = ()
) -> Imported:
    """The robot between two links of a URDF: its base frame, and its last measuring
    point; `points` between become others."""
    urdf = read_urdf(path)
    source = str(path)
    chain = chain_between(urdf, base, tip, points, source)
    masses, notes = _weights(urdf, chain)
    notes.insert(
        0,
        f"read: {', '.join(f'q{n} from {joint.name!r}' for n, joint in enumerate(chain.joints, 1))}",
    )
    limits = [_limits(joint, notes, source) for joint in chain.joints]
    document: dict[str, Any] = {
        "name": urdf.name,
        "joint_names": [joint.name for joint in chain.joints],
    }
    document |= {"chain": chain.notation, "joint_limits_deg": limits}
    # The tree's root is upright.
    before = np.linalg.multi_dot(
        [np.eye(4), np.eye(4), *(joint.origin for joint in urdf.path_to(base, None))]
    )
    gravity = np.round(-STANDARD_GRAVITY * before[2, :3], _DECIMALS) + 0.0
    if gravity[2] != -STANDARD_GRAVITY:
        document["gravity_m_s2"] = gravity.tolist()
        notes.append(
            f"gravity as at {base!r} where the root of the tree stands upright and the joints before it are at zero"
        )
    if masses:
        document["masses"] = masses
        notes.append(
            f"masses are known to {100 * _MASS_STD:g} %, by assumption: a URDF does not say"
        )
    if beside := [
        joint.name
        for joint in urdf.joints
        if joint.kind != "fixed" and joint.child not in chain.links
    ]:
        notes.append(
            f"joints that are no part of the chain, left out: {', '.join(beside)}"
        )
    return check_imported(document, path, f"the links from {base!r} to {tip!r}", notes)


def _limits(joint: Joint, notes: list[str], source: str) -> list[float]:
    """Degrees, of prismatic joints metres; a turn either way where a joint that turns
    has none, or none in radians."""
    low = joint.lower
    high = joint.upper
    prismatic = joint.kind == "prismatic"
    if low >= high and prismatic:
        allowed = 'of a prismatic joint, <limit lower="..." upper="..."> in metres'
        raise InputError(
            source, f"joint {joint.name!r}: limit", f"{low:g} to {high:g}", allowed
        )
    if prismatic or (low < high and max(-low, high) <= _FARTHEST_RAD):
        return [
            round(value if prismatic else math.degrees(value), _DECIMALS)
            for value in (low, high)
        ]
    if joint.kind != "continuous":
        found = (
            f"limits of {low:g} to {high:g}, no radians"
            if low < high
            else "no limits in the URDF"
        )
        notes.append(f"joint {joint.name!r} has {found}: a turn either way")
    return list(UNLIMITED_DEG)


def read_urdf(path: str | Path) -> Urdf:
    """Links, joints and masses of a URDF file; one whose joints and links do not hold
    together is refused."""
    source = Path(path).as_posix()
    root = _root_of(read_bytes(path, LARGEST_BYTES, "a URDF file"), source)
    links = root.findall("link")
    joints = root.findall("joint")
    _check_tree(links, joints, source)
    moments = {}
    for part in links:
        called = f"link {part.attrib['name']!r}"
        inertial = part.find("inertial")
        mass = 0.0
        centre = [0.0, 0.0, 0.0]
        if inertial is not None:
            centre = _numbers(inertial, "origin", "xyz", called, source)
            if inertial.find("mass") is not None:
                (mass,) = _numbers(inertial, "mass", "value", called, source)
            if mass < 0:
                raise InputError(
                    source, f"{called}: mass value", f"{mass:g}", "0 or more kg"
                )
        moments[part.attrib["name"]] = mass * np.array([*centre, 1.0])
    made = tuple(_joint(part, source) for part in joints)
    return Urdf(
        root.get("name") or Path(path).stem,
        moments,
        made,
        {joint.child: joint for joint in made},
    )


def _joint(part: Element, source: str) -> Joint:
    name = part.attrib["name"]

    def numbers(tag: str, attribute: str) -> list[float]:
        return _numbers(part, tag, attribute, f"joint {name!r}", source)

    origin = origin_transform(numbers("origin", "xyz"), numbers("origin", "rpy"))
    (lower,), (upper,), axis = (
        numbers("limit", "lower"),
        numbers("limit", "upper"),
        np.array(numbers("axis", "xyz")),
    )
    ends = _end(part, "parent"), _end(part, "child")
    return Joint(
        name,
        part.attrib["type"],
        *ends,
        origin,
        axis,
        lower,
        upper,
        part.find("mimic") is not None,
    )


def _numbers(
    part: Element, tag: str, attribute: str, called: str, source: str
) -> list[float]:
    """Numbers of an attribute of a child, or what they are where nothing states
    them."""
    count, default = _NUMBERS[tag, attribute]
    child = part.find(tag)
    text = default if child is None else child.get(attribute, default)
    # Programs write 1e16 and more where a joint has no limit.
    largest = 1e100 if tag == "limit" else LARGEST_NUMBER
    words = text.split(None, count)
    numbers = [
        number for each in words if (number := parse_number(each, largest)) is not None
    ]
    if not len(words) == len(numbers) == count:
        allowed = f"{'a number' if count == 1 else f'{count} numbers'}, up to {largest:g} in size"
        raise InputError(source, f"{called}: {tag} {attribute}", repr(text), allowed)
    return numbers


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree whose names have no namespaces; what could grow without end, and
    what xacro has not read, is refused."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.source = source
        self.count = 0
        self.depth = 0

    def doctype(self, *_: object) -> None:
        allowed = "a URDF without a document type, for entities of one could be endless or other files"
        raise InputError(self.source, "", "<!DOCTYPE", allowed)

    def start(self, tag: str, attrs: dict[str, str]) -> Element:
        uri, _, name = tag.rpartition("}")
        self.count = self.count + 1
        self.depth = self.depth + 1
        if self.count > _MOST_ELEMENTS or self.depth > _DEEPEST:
            most = (
                f"{_DEEPEST} elements in each other"
                if self.depth > _DEEPEST
                else f"{_MOST_ELEMENTS} elements"
            )
            raise InputError(
                self.source, "", f"more than {most}", "a URDF, which needs fewer"
            )
        if "xacro" in uri:
            raise InputError(self.source, "", f"<xacro:{name}>", _XACRO)
        if wrong := next(
            (value for value in attrs.values() if "${" in value or "$(" in value), None
        ):
            raise InputError(self.source, f"<{name}>", repr(wrong), _XACRO)
        return super().start(name, attrs)

    def end(self, tag: str) -> Element:
        self.depth -= 1
        return super().end(tag.rpartition("}")[2])


def _root_of(data: bytes, source: str) -> Element:
    try:
        root = ElementTree.fromstring(
            data, ElementTree.XMLParser(target=_Builder(source))
        )
    except ElementTree.ParseError as error:
        where = f"line {error.position[0]}"
        words = str(error).partition(":")[0]
        raise InputError(source, where, words, "a URDF, which is XML") from None
    except (ValueError, LookupError) as error:
        raise (
            error
            if isinstance(error, InputError)
            else InputError(source, "", str(error), "a URDF, which is XML")
        ) from None
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
            found = f"type {joint_type!r}"
            raise InputError(source, key, found, " | ".join(_KINDS))
        ends = {tag: _end(joint, tag) for tag in ("parent", "child")}
        for tag, link in ends.items():
            if link not in link_names:
                found = f"{tag} {link!r}"
                raise InputError(source, key, found, "a link of this file")
        child = ends["child"]
        if child in parents:
            found = f"child {child!r}, which another joint has too"
            raise InputError(source, key, found, "a tree: each link below one joint")
        parents[child] = ends["parent"]
    try:
        TopologicalSorter(
            {child: [parent] for child, parent in parents.items()}
        ).prepare()
    except CycleError as error:
        key = f"link {error.args[1][0]!r}"
        allowed = "a tree: no link below itself"
        raise InputError(source, key, "a loop of joints", allowed) from None


def _check_names(tag: str, elements: Sequence[Element], source: str) -> None:
    """Refuse no elements, too many, and names that are missing or used twice."""
    if not 0 < len(elements) <= _MOST_PARTS:
        found = f"{len(elements)} times <{tag}>" if elements else f"no <{tag}>"
        allowed = f"a URDF with links and joints, at most {_MOST_PARTS}"
        raise InputError(source, "", found, allowed)
    counts = Counter(element.get("name", "") for element in elements)
    for name, count in counts.items():
        if count > 1 or not name:
            allowed = "a name for each, and each name once"
            raise InputError(source, f"{tag} {name!r}", f"{count} times", allowed)


def chain_between(
    urdf: Urdf, base: str, tip: str, points: Sequence[str], source: str
) -> UrdfChain:
    """The chain from one link, `base`, to another that it carries; `points`, links of
    it, and the tip are measuring points."""
    path = _path(urdf, base, tip, source)
    on_chain = [base, *(joint.child for joint in path)]
    for name in points:
        if name not in on_chain:
            allowed = (
                f"a link between {base!r} and {tip!r}: {suggest_names(name, on_chain)}"
            )
            raise InputError(source, "point", repr(name), allowed)
    marked = {name: point_name(name) for name in (*points, tip)}
    if len(set(marked.values())) < len(marked):
        allowed = "links whose names differ by more than blanks and brackets"
        raise InputError(source, "point", ", ".join(map(repr, marked)), allowed)
    words = [f"[{marked[base]}]"] if base in marked else []
    moving: list[Joint] = []
    body = 0
    here = np.eye(4)
    links = {base: (body, here)}
    for joint in path:
        words += displacement_words(joint.origin)
        here = here @ joint.origin
        if joint.kind in _MOVING:
            # Of a shorter axis the direction is no more than rounding.
            if not np.linalg.norm(joint.axis) > 1e-9:
                axis = " ".join(f"{part:g}" for part in joint.axis)
                raise InputError(
                    source, f"joint {joint.name!r}: axis xyz", axis, "a direction"
                )
            moving.append(joint)
            before, letter, minus, after, turn = express_axis(joint.axis)
            body = len(moving)
            here = homogeneous(turn.T)
            words += [*before, f"{_MOVING[joint.kind]}{letter}({minus}q{body})", *after]
        if joint.child in marked:
            words.append(f"[{marked[joint.child]}]")
        links[joint.child] = (body, here)
    return UrdfChain(" ".join(words), tuple(moving), links)


def _path(urdf: Urdf, base: str, tip: str, source: str) -> list[Joint]:
    names = [*urdf.moments]
    both = f"base {base!r}, tip {tip!r}"
    for key, name in (("base", base), ("tip", tip)):
        if name not in names:
            raise InputError(
                source, key, repr(name), f"a link: {suggest_names(name, names)}"
            )
    path = urdf.path_to(tip, base)
    if base != (path[0].parent if path else tip):
        turned = any(joint.parent == tip for joint in urdf.joints_above(base))
        found = (
            "a base that the tip carries (give them the other way round)"
            if turned
            else "two branches of the tree"
        )
        raise InputError(source, both, found, "a tip that the base carries")
    if not any(joint.kind in _MOVING for joint in path):
        raise InputError(
            source,
            both,
            "no joint that moves between them",
            "links with joints between",
        )
    if wrong := next(
        (
            joint
            for joint in path
            if joint.mimics or joint.kind not in (*_MOVING, "fixed")
        ),
        None,
    ):
        found = (
            "a joint that mimics another one" if wrong.mimics else f"type {wrong.kind}"
        )
        allowed = f"{' | '.join((*_MOVING, 'fixed'))}; parallel links are written in the robot file, see docs/campaign.md"
        raise InputError(source, f"joint {wrong.name!r}", found, allowed)
    return path


def _weights(urdf: Urdf, chain: UrdfChain) -> tuple[list[dict[str, Any]], list[str]]:
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
