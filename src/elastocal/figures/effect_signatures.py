"""What each effect of the catalogue does to a measured point: over a joint's angle, over
a load, and over time.

Effects are distinguishable by these dependences, so the same three experiments on one
arm show all of them.
"""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from elastocal.effects.catalogue import list_effects
from elastocal.effects.conditions import Timeline, build_conditions
from elastocal.effects.protocol import Candidate
from elastocal.figures.style import MILLI, PALETTE, create_panels, styled
from elastocal.fitting.model import sum_displacements
from elastocal.fitting.observations import States
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.sites import PushedSession, Sites, build_sites

# The joint that carries the arm shows most effects; an effect that can act at several
# joints is shown at this one.
_PREFERRED_JOINT = 2
# Robot files need not state gear ratios; gears of heavy arms reduce by about this much.
_GEAR_RATIO = 100.0
# A bent arm, so that no effect is hidden by a lever that happens to be zero.
_POSE_DEG = (20.0, 10.0, 15.0, 30.0, 45.0, 20.0, 30.0)
# A reflector off the axis of the last joint, so that rotations of the joint are visible.
_REFLECTOR_M = (0.1, 0.0, 0.1)
# The force acts across all axes of the arm.
_FORCE_DIRECTION = np.array([0.5, 0.5, -(0.5**0.5)])
_MAX_FORCE_N = 1000.0
# Half a working day, in which the hall and the motors warm the arm from the temperature
# at which dimensions are stated.
_DURATION_H = 4.0
_START_C = 20.0
_RISE_K = 10.0
_MAX_SWEEP_DEG = 180.0
_SAMPLES = 73
_SECONDS_PER_HOUR = 3600.0

_FORCE_N = np.linspace(-_MAX_FORCE_N, _MAX_FORCE_N, _SAMPLES)
_TIME_H = np.linspace(0, _DURATION_H, _SAMPLES)
_NO_FORCE_N = np.zeros(_SAMPLES)
# Time of the experiments that do not vary it: the middle of the campaign.
_MIDDLE_H = np.full(_SAMPLES, _DURATION_H / 2)


@dataclass(frozen=True)
class Signature:
    """The displacements that an effect causes at one location of the arm.

    Attributes
    ----------
    candidate : Candidate
        The effect; all its parameters have their plausible sizes, and its shapes the
        values at which a search starts.
    joint : int
        The joint whose angle is varied, from 1.
    angle_deg : (S,) array
    displacement_mm : dict of (S, 3) arrays
        Displacement of the reflector in base axes: "by angle", "by angle, loaded" with
        the largest force, "by force" while it rises, "by force, falling", "by time".
    """

    candidate: Candidate
    joint: int
    angle_deg: np.ndarray
    displacement_mm: dict[str, np.ndarray]


@dataclass(frozen=True)
class _Experiment:
    """One experiment on the arm.

    Attributes
    ----------
    joint_angles : (S, n) array, rad
    force_N : (S,) array
        Force on the end-effector.
    time_h : (S,) array
        Time since the start of the campaign.
    approach : float
        Direction of approach of all joints, 1 or -1.
    """

    joint_angles: np.ndarray
    force_N: np.ndarray
    time_h: np.ndarray
    approach: float = 1.0

    @property
    def states(self) -> States:
        """The states that the experiment measures."""
        numbers = np.arange(_SAMPLES)
        ones = np.ones(_SAMPLES, int)
        elapsed = self.time_h / _DURATION_H
        force = np.outer(self.force_N, _FORCE_DIRECTION)
        return States(
            session=0 * ones,
            pose=numbers,
            load=ones,
            joint_angles=self.joint_angles,
            wrench=np.pad(force, ((0, 0), (0, 3))),
            repeats=ones,
            approach=np.full(self.joint_angles.shape, self.approach),
            time_s=_SECONDS_PER_HOUR * _DURATION_H * elapsed,
            temperature_c=_START_C + _RISE_K * elapsed,
            row=elapsed,
        )


def compute_signature(name: str, robot: Robot) -> Signature:
    """Compute the signature of an effect on an arm.

    Parameters
    ----------
    name : str
        Name of an effect of the catalogue.
    robot : Robot
        A robot with compliances, and with a compensator for the effects of one. The
        masses of its links are ignored unless the effect needs them, because the weight
        of links is an effect only if it is not declared.
    """
    candidate = _choose_candidate(list_candidates(name, robot))
    sites = _find_sites(name, robot)
    joint = (*candidate.joints, *candidate.turning, _PREFERRED_JOINT)[0]
    limits_deg = np.degrees(robot.joint_limits[joint - 1])
    low, high = np.clip(limits_deg, -_MAX_SWEEP_DEG, _MAX_SWEEP_DEG)
    angle_deg = np.linspace(low, high, _SAMPLES)
    fixed = np.tile(np.radians(_POSE_DEG[: robot.joints]), (_SAMPLES, 1))
    swept = fixed.copy()
    swept[:, joint - 1] = np.radians(angle_deg)
    full_force = np.full(_SAMPLES, _MAX_FORCE_N)
    experiments = {
        "by angle": _Experiment(swept, _NO_FORCE_N, _MIDDLE_H),
        "by angle, loaded": _Experiment(swept, full_force, _MIDDLE_H),
        "by force": _Experiment(fixed, _FORCE_N, _MIDDLE_H),
        "by force, falling": _Experiment(fixed, _FORCE_N, _MIDDLE_H, approach=-1.0),
        "by time": _Experiment(fixed, _NO_FORCE_N, _TIME_H),
    }
    displacements = {
        label: _compute_displacement(candidate, sites, robot.compliance, experiment)
        for label, experiment in experiments.items()
    }
    return Signature(candidate, joint, angle_deg, displacements)


def _choose_candidate(candidates: list[Candidate]) -> Candidate:
    """The candidate at the preferred joint, or the first one."""
    for candidate in candidates:
        if candidate.joints[:1] == (_PREFERRED_JOINT,):
            return candidate
    return candidates[0]


def _compute_displacement(
    candidate: Candidate,
    sites: Sites,
    compliance: np.ndarray,
    experiment: _Experiment,
) -> np.ndarray:
    """Displacement (S, 3) of the reflector in mm, base axes, by one effect."""
    conditions = build_conditions(
        sites, compliance, experiment.states, timeline=Timeline(row_span=(0, 1))
    )
    sizes = np.array(
        [
            (parameter.sign or 1) * parameter.plausible
            for parameter in candidate.parameters
        ]
    )
    shapes = [shape.start for shape in candidate.shapes]
    commanded = sites.chain.at(experiment.joint_angles)
    displaced = commanded.copy()
    shifts = sum_displacements([(candidate, sizes, shapes)], conditions)
    for coordinate, shift in shifts.items():
        displaced[:, coordinate] += shift
    reflector = replace(sites.chain.end_effector, offset_m=_REFLECTOR_M)
    after, _ = compute_poses(sites.chain, displaced, reflector)
    before, _ = compute_poses(sites.chain, commanded, reflector)
    return MILLI * (after - before)


def list_candidates(name: str, robot: Robot) -> list[Candidate]:
    """List every way in which an effect can act on the arm, see `compute_signature`."""
    return list_effects()[name].candidates(_find_sites(name, robot))


def _find_sites(name: str, robot: Robot) -> Sites:
    """Sites of the arm without masses, unless the effect exists only with them."""
    with_masses = replace(
        build_sites(robot),
        gear_ratio=(_GEAR_RATIO,) * robot.joints,
        pushed_sessions=(PushedSession(0, 0.0, 1.0),),
    )
    without_masses = replace(with_masses, masses=())
    if list_effects()[name].candidates(without_masses):
        return without_masses
    return with_masses


@styled
def draw_signature(signature: Signature) -> Figure:
    """Draw a signature in three panels with one scale of millimetres: angle of the
    joint, force, time."""
    figure, axes = create_panels(1, 3, 58, sharey=True)
    # The same margins suit all signatures; computing a layout takes longer than drawing.
    figure.set_layout_engine(None)
    figure.subplots_adjust(left=0.085, right=0.99, bottom=0.18, top=0.96, wspace=0.08)
    angle, force, time = axes[0]
    displacement = signature.displacement_mm
    loaded = f"pulled by {_MAX_FORCE_N:.0f} N"
    angle_deg = signature.angle_deg
    _draw_curves(angle, angle_deg, displacement["by angle"], "-", "unloaded")
    _draw_curves(angle, angle_deg, displacement["by angle, loaded"], "--", loaded)
    _draw_curves(force, _FORCE_N, displacement["by force"], "-", "approached upwards")
    falling = displacement["by force, falling"]
    _draw_curves(force, _FORCE_N, falling, ":", "approached downwards")
    _draw_curves(time, _TIME_H, displacement["by time"], "-", "")
    angle.set(
        xlabel=f"angle of joint {signature.joint} (°)", ylabel="displacement (mm)"
    )
    force.set(
        xlabel="force on the end-effector (N)", xticks=(-_MAX_FORCE_N, 0, _MAX_FORCE_N)
    )
    time.set(xlabel=f"time (h), warming by {_RISE_K:.0f} K")
    # One grey line explains each dash pattern; the last panel explains the colours.
    for panel in (angle, force):
        patterns = {line.get_linestyle(): line.get_label() for line in panel.lines}
        handles = [
            Line2D([], [], color="#4D4D4D", linestyle=dashes, label=label)
            for dashes, label in patterns.items()
        ]
        panel.legend(handles=handles, loc="upper left")
    axis_labels = ["along x", "along y", "along z"]
    time.legend(handles=time.lines[:3], labels=axis_labels, loc="upper left")
    largest = max(np.abs(curves).max() for curves in displacement.values())
    # Leave space for the legends above the curves.
    angle.set_ylim(-1.1 * largest, 2.1 * largest)
    return figure


def _draw_curves(
    panel: Axes, x: np.ndarray, curves: np.ndarray, dashes: str, label: str
) -> None:
    """Draw the three components (S, 3) of a displacement, a colour for each."""
    for component, colour in zip(curves.T, PALETTE[:3], strict=True):
        panel.plot(x, component, dashes, color=colour, label=label)
