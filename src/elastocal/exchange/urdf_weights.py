"""What the links of a URDF weigh, as the masses of a robot file: see `mechanics.robot_file`.

All that a joint carries rigidly is one mass, side branches and what stands behind the tip included.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elastocal.counting import first_names
from elastocal.exchange.mass_deviations import OF_URDF
from elastocal.exchange.robot_text import mass_entries
from elastocal.exchange.urdf_chain import Carried, UrdfChain, joints_above, parent_joints
from elastocal.exchange.urdf_reading import Urdf
from elastocal.mechanics.robot import STANDARD_GRAVITY

# Of gravity, m/s².
_DECIMALS = 9
# So many links of a robot never weigh the same.
_FEWEST_ALIKE = 3
# Links and joints that a note names.
_NAMED = 4


@dataclass(frozen=True)
class Weights:
    """Entries of ``masses`` of a robot file, and what is to be said of them."""

    masses: list[dict[str, Any]]
    notes: tuple[str, ...]


def weights_of(urdf: Urdf, chain: UrdfChain, relative_std: float = OF_URDF) -> Weights:
    """Masses and centres of what each joint carries; `relative_std` is how well they are known."""
    moments: dict[int, np.ndarray] = {}
    at_zero, passive = set(), set()
    for link in urdf.links:
        carried = _find_carrier(urdf, link.name, chain) if link.mass else None
        # What moves beside the column weighs on no joint of the chain.
        if carried is None or (carried[0].body == 0 and carried[1]):
            continue
        place, by = carried
        at_zero.update(by)
        if place.behind_passive:
            passive.add(link.name)
        moments[place.body] = moments.get(place.body, np.zeros(4)) + link.mass * place.transform @ np.append(link.centre, 1.0)
    alike = {float(moment[3]) for moment in moments.values()}
    if len(moments) >= _FEWEST_ALIKE and len(alike) == 1:
        return Weights([], (f"every link weighs {alike.pop():g} kg: placeholders, which are left out",))
    notes = []
    if at_zero:
        notes.append(f"joints beside the chain are held at zero for what they carry: {first_names(sorted(at_zero), _NAMED)}")
    if passive:
        notes.append(f"behind a passive joint, but weighing as if it did not turn: {first_names(sorted(passive), _NAMED)}")
    if not moments:
        notes.append("no masses: the weight of the links is not known")
    return Weights(mass_entries(moments, relative_std), tuple(notes))


def gravity_in_base(urdf: Urdf, base: str) -> list[float] | None:
    """Gravity in a link's axes, m/s², None down its z axis: the tree's root is upright and joints before it are at zero."""
    transform = np.eye(4)
    for joint in joints_above(urdf, base):
        transform = joint.origin @ transform
    gravity = np.round(-STANDARD_GRAVITY * transform[2, :3], _DECIMALS) + 0.0
    return None if gravity[2] == -STANDARD_GRAVITY else gravity.tolist()


def _find_carrier(urdf: Urdf, link: str, chain: UrdfChain) -> tuple[Carried, list[str]] | None:
    """Where a link is on the chain, and the joints beside the chain that move it; None where the chain does not carry it."""
    above, transform, by, at = parent_joints(urdf), np.eye(4), [], link
    while at not in chain.links:
        if at not in above:
            return None
        joint = above[at]
        transform = joint.origin @ transform
        if joint.kind != "fixed":
            by.append(joint.name)
        at = joint.parent
    place = chain.links[at]
    return replace(place, transform=place.transform @ transform), by
