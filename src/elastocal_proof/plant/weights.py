"""What the links of an arm weigh: as declared, as guessed where nobody declared it, and as it is true of one specimen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.arm import Arm, LinkMass, Stretch, link_frames
from elastocal_proof.plant.structure import Mass

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Mass of an arm by rated load (kg) times reach (m): m = 3.2 (P R)^0.92 goes through an arm of 30 kg for 14 kg at 0.82 m and has
# 1380 kg for 270 kg at 2.7 m, where a data sheet has 1130: a size to be expected, not the mass of one machine.
_SCALE_KG, _POWER = 3.2, 0.92
# Of it in the foot and in the carousel with its motors; the rest halves from link to link.
_FOOT, _CAROUSEL, _FALL = 0.18, 0.27, 0.5
_ALONG, _ASIDE = 0.45, 0.01
_GUESSED_STD = 0.1
# A centre that lies on its joint's axis is known no better than this.
_SHORTEST_LEVER_M = 0.1
# Width of a link over the reach of the arm: within it centres of mass lie anywhere.
_WIDTH_OF_REACH = 0.1
# Standard deviations; beyond them nobody's declaration would be believed.
_FARTHEST = 3.0
_POSES = 64


def declared_masses(arm: Arm) -> tuple[LinkMass, ...]:
    """What the robot file says the links weigh, or a rule where it says nothing."""
    if arm.masses:
        return arm.masses
    total = _SCALE_KG * (arm.payload_kg * arm.reach_m) ** _POWER
    falling = _FALL ** np.arange(arm.joints - 1)
    shares = [_FOOT, _CAROUSEL, *((1.0 - _FOOT - _CAROUSEL) * falling / falling.sum())]
    return tuple(
        LinkMass(link, round(float(share * total), 1), _guessed_centre(stretch, arm.reach_m), _GUESSED_STD)
        for link, (share, stretch) in enumerate(zip(shares, arm.stretches, strict=True))
    )


def _guessed_centre(stretch: Stretch, reach_m: float) -> tuple[float, ...]:
    """Before the middle of the link, and a little to the side, where the motors sit; mm."""
    return tuple(np.round(_ALONG * stretch.vector_m + [0.0, _ASIDE * reach_m, 0.0], 3).tolist())


def centre_std_m(mass: LinkMass) -> float:
    """Standard deviation of each component of a declared centre of mass, m."""
    return mass.relative_std * max(float(np.linalg.norm(mass.centre_m)), _SHORTEST_LEVER_M)


def allowed_centre_std_m(mass: LinkMass, reach_m: float) -> float:
    """Standard deviation that an analyst must allow each component of a centre, who does not know how far aside it lies, m."""
    return mass.relative_std * max(float(np.linalg.norm(mass.centre_m)), _WIDTH_OF_REACH * reach_m)


def true_masses(masses: Iterable[LinkMass], draws: np.random.Generator) -> tuple[LinkMass, ...]:
    """Masses and centres of one specimen, drawn about the declared ones as well as these are known."""
    found = []
    for mass in masses:
        heavier, *moved = np.clip(draws.standard_normal(4), -_FARTHEST, _FARTHEST)
        centre = np.array(mass.centre_m) + centre_std_m(mass) * np.array(moved)
        found.append(replace(mass, mass_kg=mass.mass_kg * (1.0 + mass.relative_std * heavier), centre_m=tuple(centre)))
    return tuple(found)


def off_the_line(masses: Iterable[LinkMass], arm: Arm, largest_m: float, draws: np.random.Generator) -> tuple[LinkMass, ...]:
    """Centres moved off the lines of their links by up to a distance across each, as nobody declared.

    `largest_m`: of each of the two components across the link.
    """
    found = []
    for mass in masses:
        move = draws.uniform(-largest_m, largest_m, 3)
        vector = arm.stretches[mass.link].vector_m
        if vector.any():
            along = vector / np.linalg.norm(vector)
            move = move - (move @ along) * along
        found.append(replace(mass, centre_m=tuple(np.array(mass.centre_m) + move)))
    return tuple(found)


def on_stretches(masses: Iterable[LinkMass], arm: Arm) -> tuple[Mass, ...]:
    """The same weights as a structure has them: along the line of the stretch, and aside of it."""
    found = []
    for mass in masses:
        centre, vector = np.array(mass.centre_m), arm.stretches[mass.link].vector_m
        along = float(np.clip(centre @ vector / (vector @ vector), 0.0, 1.0)) if vector.any() else 0.0
        found.append(Mass(mass.link, mass.mass_kg, along, tuple((centre - along * vector).tolist())))
    return tuple(found)


def gravity_torque(arm: Arm, masses: Iterable[Mass], gravity_m_s2: Sequence[float], angles: np.ndarray) -> np.ndarray:
    """Torque of the links' weight on each drive, by levers.

    `angles` (S, n): rad. Returns (S, n): N m.
    """
    origin, rotation = link_frames(arm, angles)
    torque = np.zeros(angles.shape)
    for mass in masses:
        centre = mass.along * arm.stretches[mass.stretch].vector_m + np.array(mass.aside_m)
        place, force = origin[:, mass.stretch] + rotation[:, mass.stretch] @ centre, mass.mass_kg * np.array(gravity_m_s2)
        for joint in range(mass.stretch):
            axis = rotation[:, joint + 1] @ arm.axes[joint]
            torque[:, joint] += (np.cross(place - origin[:, joint + 1], force) * axis).sum(axis=1)
    return torque


def usual_gravity_torque(arm: Arm, masses: Iterable[Mass], gravity_m_s2: Sequence[float]) -> np.ndarray:
    """Root mean square of `gravity_torque` over the arm's range of angles, ndarray (n,), N m."""
    low, high = arm.limits.T
    # The same poses for all, of no campaign.
    angles = low + (high - low) * np.random.default_rng(0).random((_POSES, arm.joints))
    return np.sqrt((gravity_torque(arm, masses, gravity_m_s2, angles) ** 2).mean(axis=0))
