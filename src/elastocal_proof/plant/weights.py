"""What the links of an arm weigh: as declared, as guessed where nobody declared it, and as it is true of one specimen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.arm import Arm, LinkMass
from elastocal_proof.plant.machine import Mass, Structure, machine_of

if TYPE_CHECKING:
    from collections.abc import Iterable

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
    # Centres before the middle of the link, and a little to the side, where the motors sit; to the millimetre.
    aside = np.array([0.0, _ASIDE * arm.reach_m, 0.0])
    centres = [tuple(np.round(_ALONG * stretch.vector_m + aside, 3).tolist()) for stretch in arm.stretches]
    return tuple(
        LinkMass(link, round(float(share * total), 1), centre, _GUESSED_STD)
        for link, (share, centre) in enumerate(zip(shares, centres, strict=True))
    )


def centre_std_m(mass: LinkMass, least_m: float = _SHORTEST_LEVER_M) -> float:
    """Standard deviation of each component of a declared centre of mass, m: its share of the centre's distance."""
    return mass.relative_std * max(float(np.linalg.norm(mass.centre_m)), least_m)


def allowed_centre_std_m(mass: LinkMass, reach_m: float) -> float:
    """Standard deviation that an analyst must allow each component of a centre, who does not know how far aside it lies, m."""
    return centre_std_m(mass, _WIDTH_OF_REACH * reach_m)


def true_masses(masses: Iterable[LinkMass], draws: np.random.Generator) -> tuple[LinkMass, ...]:
    """Masses and centres of one specimen, drawn about the declared ones as well as these are known."""
    found = []
    for mass in masses:
        heavier, *moved = np.clip(draws.standard_normal(4), -_FARTHEST, _FARTHEST)
        centre = np.array(mass.centre_m) + centre_std_m(mass) * np.array(moved)
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


def on_stretches(masses: Iterable[LinkMass], arm: Arm) -> tuple[Mass, ...]:
    """The same weights as a structure has them: along the line of the stretch, and aside of it."""
    found = []
    for mass in masses:
        centre, vector = np.array(mass.centre_m), arm.stretches[mass.link].vector_m
        along = float(np.clip(centre @ vector / (vector @ vector), 0.0, 1.0)) if vector.any() else 0.0
        found.append(Mass(mass.link, mass.mass_kg, along, tuple((centre - along * vector).tolist())))
    return tuple(found)


def usual_gravity_torque(arm: Arm, masses: Iterable[Mass], gravity_m_s2: tuple[float, ...]) -> np.ndarray:
    """Root mean square torque of the links' weight on each drive over the arm's range of angles, (n,), N m."""
    low, high = arm.limits.T
    machine = machine_of(arm, Structure(masses=tuple(masses), gravity_m_s2=gravity_m_s2))
    coordinates = np.zeros((_POSES, machine.model.nq))
    # The same poses for all, of no campaign.
    coordinates[:, machine.drive] = low + (high - low) * np.random.default_rng(0).random((_POSES, arm.joints))
    torque = machine.forces(coordinates, np.zeros((_POSES, arm.joints + 1)))[0][:, machine.gear]
    return np.sqrt((torque**2).mean(axis=0))
