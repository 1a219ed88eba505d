"""What the measurements are modelled by: nominal robot, frames, targets, any set of effects, and values of what is unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import offered
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.mechanics.sites import Sites, sites_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.campaigns.campaign import Campaign, Target
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.observations import States


@dataclass(frozen=True)
class Model:
    """What is taken to make the measurements.

    `targets`: as in the campaign; offsets and rotations that they do not have are fitted. `fitted_frames`: whether the
    placement of the base is unknown, one for each session. `rows`: 3 where positions are measured, 6 where poses are.
    `nominal_compliance` (n,): rad/(N m). `effects`: joint compliances, where they are identified, and errors of declared
    masses, where there are any, among them. `time_zero_s`: from which effects count the time: the first measurement to be
    fitted. `row_span` (int, int): first and last row of the measurements to be fitted, between which the campaign made its
    progress. `compliance_known`: whether the nominal compliances are those of the robot file; else they are usual ones, or 0 of
    joints taken as rigid.
    """

    sites: Sites
    targets: tuple[Target, ...]
    fitted_frames: bool
    rows: int
    nominal_compliance: np.ndarray
    effects: tuple[Candidate, ...] = ()
    time_zero_s: float = 0.0
    row_span: tuple[int, int] | None = None
    compliance_known: bool = True

    @property
    def identifies_compliance(self) -> bool:
        """Whether the joint compliances are parameters."""
        return any(effect.effect == "joint_compliance" for effect in self.effects)

    @property
    def fitted_parts(self) -> list[tuple[int, slice]]:
        """Targets that are fitted, and which of shift and turn (x, y, z, rx, ry, rz) are."""
        found = []
        for number, target in enumerate(self.targets):
            first, last = (0 if target.offset_m is None else 3), (self.rows if target.rotation is None else 3)
            if first < last:
                found.append((number, slice(first, last)))
        return found

    def offered(self, states: States) -> frozenset[str]:
        """What effects may need that some states and the campaign have: see `Candidate.needs`."""
        return offered(self.sites, states) | (frozenset() if self.fitted_frames else {"declared base"})

    def with_effects(self, effects: Iterable[Candidate]) -> Model:
        """The same model with more effects."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Estimate:
    """Values of everything that a model leaves open.

    `frame_rotation`, `frame_position` (K, 3, 3), (K, 3): placement of the base in the frame of each session. `target_offset`,
    `target_rotation` (T, 3), (T, 3, 3): each target in the frame of its measuring point, m. `coefficients`: linear parameters
    of each effect. `shapes`: shape parameters of each effect.
    """

    sessions: tuple[int, ...]
    frame_rotation: np.ndarray
    frame_position: np.ndarray
    target_offset: np.ndarray
    target_rotation: np.ndarray
    coefficients: tuple[np.ndarray, ...] = ()
    shapes: tuple[np.ndarray, ...] = ()

    def with_effects(self, effects: Sequence[Candidate]) -> Estimate:
        """The same estimate with more effects, all of them at zero."""
        return replace(
            self,
            coefficients=(*self.coefficients, *(np.zeros(len(effect.parameters)) for effect in effects)),
            shapes=(*self.shapes, *(np.array([shape.start for shape in effect.shapes]) for effect in effects)),
        )


def declared_model(campaign: Campaign, effects: Iterable[Candidate] = ()) -> Model:
    """The model that a campaign declares.

    `effects`: declared effects.
    """
    sites = sites_of(campaign.robot)
    # Under an arm whose first joint turns, a base that yields and the sag of that arm are one thing until weights are known.
    unknown = not sites.masses and not campaign.measurements.wrench.any()
    sites = replace(sites, usual_weight=sites.prismatic[0] and unknown)
    springs = (joint_compliance(sites),) if campaign.compliance == "identify" else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    return Model(
        sites,
        campaign.targets,
        campaign.frame == "tracker",
        6 if campaign.measured == "pose" else 3,
        campaign.robot.compliance,
        (*springs, *weight, *effects),
        0.0 if campaign.measurements.time_s is None else float(campaign.measurements.time_s.min()),
        (int(campaign.measurements.row.min()), int(campaign.measurements.row.max())) if len(campaign.measurements) else None,
        campaign.robot.compliance_known,
    )
