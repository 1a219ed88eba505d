"""What each effect of the catalogue does to a measured point: along a joint's angle, up
and down a load, and over time.

Effects are distinguishable by these dependences, so that all are shown by the same
three experiments on one arm.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from elastocal.effects.catalogue import list_effects
from elastocal.effects.conditions import conditions_of
from elastocal.effects.protocol import Candidate
from elastocal.figures.style import PALETTE, create_panels, styled
from elastocal.fitting.model import sum_displacements
from elastocal.fitting.observations import States
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.sites import Sites, sites_of

# The joint that bears the arm shows most effects; one that can act at several joints is
# shown there.
_SHOWN_AT = 2
# No robot file has to state its gears; those of heavy arms reduce about so much.
_GEAR_RATIO = 100.0
# A bent arm: no effect is hidden by a lever that happens to be zero.
_POSE_DEG = (20.0, 10.0, 15.0, 30.0, 45.0, 20.0, 30.0)
# A reflector beside the axis of the last joint, so that its turns are seen.
_REFLECTOR_M = (0.1, 0.0, 0.1)
# Across all axes of the arm, and over all its links.
_PULL = np.array([0.5, 0.5, -(0.5**0.5)])
_PULL_N = 1000.0
# Four hours of a working day; the hall and the motors warm the arm from the temperature
# at which dimensions are stated.
_HOURS = 4.0
_LOWEST_C = 20.0
_RISE_K = 10.0
_WIDEST_SWEEP_DEG = 180.0
_SAMPLES = 73
_HOUR_S = 3600.0


_FORCE_N = np.linspace(-_PULL_N, _PULL_N, _SAMPLES)
_TIME_H = np.linspace(0, _HOURS, _SAMPLES)


@dataclass(frozen=True)
class Signature:
    """An effect at one location of the arm, displaced through the three experiments.

    `candidate`: with all its parameters at their plausible sizes and its shapes where a
    search starts. `joint`: whose angle is varied, counted from 1. `angle_deg` (S,).
    `moved` (S, 3): displacement of the reflector in mm, base axes: "by angle", "by
    angle, loaded" by the largest pull, "by force" while it rises, "by force, falling",
    and "by time".
    """

    candidate: Candidate
    joint: int
    angle_deg: np.ndarray
    moved: dict[str, np.ndarray]


def compute_signature(name: str, robot: Robot) -> Signature:
    """The signature of an effect on an arm.

    `name`: of an effect of the catalogue. `robot`: with compliances, and with a
    compensator for the effects of one. What its links weigh is left aside, since the
    weight of links is an effect only where it is not declared.
    """
    offered = list_candidates(name, robot)
    sites = _sites(name, robot)
    candidate = next(
        (each for each in offered if each.joints[:1] == (_SHOWN_AT,)), offered[0]
    )
    joint = (*candidate.joints, *candidate.turning, _SHOWN_AT)[0]
    limits = np.clip(
        np.degrees(robot.joint_limits[joint - 1]), -_WIDEST_SWEEP_DEG, _WIDEST_SWEEP_DEG
    )
    angle = np.linspace(limits[0], limits[1], _SAMPLES)
    still = np.tile(np.radians(_POSE_DEG[: robot.joints]), (_SAMPLES, 1))
    turned = still.copy()
    turned[:, joint - 1] = np.radians(angle)
    sizes = np.array(
        [
            (parameter.sign or 1) * parameter.plausible
            for parameter in candidate.parameters
        ]
    )
    point = replace(sites.chain.end_effector, offset_m=_REFLECTOR_M)

    def moved_mm(
        angles: np.ndarray,
        newtons: Any = 0.0,
        approach: float = 1.0,
        time_h: Any = _HOURS / 2,
    ) -> np.ndarray:
        """Displacement (S, 3); what an experiment does not vary is as in the middle of
        the campaign."""
        once = np.ones(_SAMPLES, int)
        share = np.broadcast_to(time_h, _SAMPLES) / _HOURS
        states = States(
            session=0 * once,
            pose=np.arange(_SAMPLES),
            load=once,
            joint_angles=angles,
            wrench=np.pad(
                np.outer(np.broadcast_to(newtons, _SAMPLES), _PULL), ((0, 0), (0, 3))
            ),
            repeats=once,
            approach=np.full(angles.shape, approach),
            time_s=_HOUR_S * _HOURS * share,
            temperature_c=_LOWEST_C + _RISE_K * share,
            row=share,
        )
        around = conditions_of(sites, robot.compliance, states, row_span=(0, 1))
        commanded = sites.chain.at(angles)
        displaced = commanded.copy()
        shapes = [shape.start for shape in candidate.shapes]
        for coordinate, by in sum_displacements(
            [(candidate, sizes, shapes)], around
        ).items():
            displaced[:, coordinate] += by
        return 1e3 * (
            poses(sites.chain, displaced, point)[0]
            - poses(sites.chain, commanded, point)[0]
        )

    moved = {
        "by angle": moved_mm(turned),
        "by angle, loaded": moved_mm(turned, _PULL_N),
        "by force": moved_mm(still, _FORCE_N),
    }
    moved |= {
        "by force, falling": moved_mm(still, _FORCE_N, -1.0),
        "by time": moved_mm(still, time_h=_TIME_H),
    }
    return Signature(candidate, joint, angle, moved)


def list_candidates(name: str, robot: Robot) -> list[Candidate]:
    """Every way in which an effect can act on the arm of the figures, see
    `signature`."""
    return list_effects()[name].candidates(_sites(name, robot))


def _sites(name: str, robot: Robot) -> Sites:
    """Without the weight of links, but for an effect that there is only where their
    masses are declared."""
    weighed = replace(sites_of(robot), gear_ratio=(_GEAR_RATIO,) * robot.joints)
    bare = replace(weighed, masses=())
    return bare if list_effects()[name].candidates(bare) else weighed


@styled
def draw_signature(shown: Signature) -> Figure:
    """Draw a signature.

    Returns three panels on one scale of millimetres: angle of the joint, force, time.
    """
    figure, axes = create_panels(1, 3, 58, sharey=True)
    # All figures alike; to search for a layout takes longer than to draw.
    figure.set_layout_engine(None)
    figure.subplots_adjust(left=0.085, right=0.99, bottom=0.18, top=0.96, wspace=0.08)
    angle, force, time = axes[0]
    looks = {
        "by angle": (angle, shown.angle_deg, "-", "unloaded"),
        "by angle, loaded": (
            angle,
            shown.angle_deg,
            "--",
            f"pulled by {_PULL_N:.0f} N",
        ),
        "by force": (force, _FORCE_N, "-", "approached upwards"),
        "by force, falling": (force, _FORCE_N, ":", "approached downwards"),
        "by time": (time, _TIME_H, "-", ""),
    }
    for name, (panel, along, dashes, label) in looks.items():
        for axis, colour in enumerate(PALETTE[:3]):
            panel.plot(
                along, shown.moved[name][:, axis], dashes, color=colour, label=label
            )
    angle.set(xlabel=f"angle of joint {shown.joint} (°)", ylabel="displacement (mm)")
    force.set(xlabel="force on the end-effector (N)", xticks=(-_PULL_N, 0, _PULL_N))
    time.set(xlabel=f"time (h), warming by {_RISE_K:.0f} K")
    # One grey line for each kind of dashes; the colours are those of the last panel.
    for panel in (angle, force):
        kinds = {line.get_linestyle(): line.get_label() for line in panel.lines}
        handles = [
            Line2D([], [], color="#4D4D4D", linestyle=dashes, label=label)
            for dashes, label in kinds.items()
        ]
        panel.legend(handles=handles, loc="upper left")
    time.legend(
        handles=time.lines[:3],
        labels=["along x", "along y", "along z"],
        loc="upper left",
    )
    largest = max(
        np.abs(line.get_ydata()).max() for panel in axes[0] for line in panel.lines
    )
    # Above the lines is room for the legends.
    angle.set_ylim(-1.1 * largest, 2.1 * largest)
    return figure
