"""Defects: all that can be wrong with a physical robot, named as in the catalogue, or ``outside:...`` where it is not there.

A defect has one size, which scales it, and a seed, from which its other details (directions, phases, thresholds) are drawn;
they do not change with the size. Laws are those of `gears`, `drives`, `structure`, `load_cell` and `tracker`: none is the
catalogue's formula where a machine would do otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.errors import InputError
from elastocal_proof.plant import drives, gears
from elastocal_proof.plant.arm import Arm
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.structure import Compensator, Mass, TaperedTube
from elastocal_proof.plant.tracker import Drift, EccentricNest, Move
from elastocal_proof.plant.weights import declared_masses, on_stretches, usual_gravity_torque

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from elastocal_proof.plant.physical_robot import DriveLaw, GearLaw, PhysicalRobot

    _Location = tuple[int, ...]
    _Locations = Callable[[Arm], list[_Location]]
    _Applied = tuple[PhysicalRobot, dict[str, float]]
    _Apply = Callable[[PhysicalRobot, list[int], float, np.random.Generator], _Applied]

OUTSIDE = "outside:"
_AXES = "xyz"
_SHORTEST_LINK_M = 0.1
_HEAVY_REACH_M = 2.5
# Radius of a bearing, and how thick a link is.
_BEARING_M, _LINK_M = 0.15, 0.25
# In the first half of the training poses, with repeats and without, at a state in 25 s.
_KNOCKED_S = (700.0, 2000.0)
# Share of the largest torque below which a weight does not turn a joint.
_NO_TORQUE = 0.003


@dataclass(frozen=True)
class Defect:
    """One thing that is wrong with a robot.

    `effect`: a key of `KINDS`. `joints`: from 1; empty where it belongs to none. `size`: in the unit of its kind. `seed`: of
    its details.
    """

    effect: str
    joints: _Location
    size: float
    seed: int = 0


@dataclass(frozen=True)
class Kind:
    """What all defects of one name have in common.

    `unit`: of the size. `plausible`: a size such as real robots have. `locations`: joints at which it can be on an arm: list of
    tuples. `apply`: ``apply(robot, joints, size, draws)`` gives the defective robot and those parameters that the catalogue's
    law of this effect has in common with what was done, by the catalogue's names; exactly or to first order in the size.
    `needs`: covariates without which the catalogue cannot see it. `largest`: size beyond which the law means nothing. `scale`:
    powers of how soft an arm is and of how large its loads are, with which the plausible size goes.
    """

    unit: str
    plausible: float
    locations: _Locations
    apply: _Apply
    needs: tuple[str, ...] = ()
    largest: float = np.inf
    scale: tuple[float, float] = (0.0, 0.0)

    def plausible_on(self, arm: Arm) -> float:
        """A size such as this arm may have; `plausible` is a heavy one's."""
        return self.plausible * arm.softness ** self.scale[0] * arm.load_share ** self.scale[1]


KINDS: dict[str, Kind] = {}


def with_defects(robot: PhysicalRobot, defects: Iterable[Defect]) -> PhysicalRobot:
    """A robot with defects, one after another."""
    for defect in defects:
        robot = _applied(robot, defect)[0]
    return robot


def truth_of(robot: PhysicalRobot, defect: Defect) -> dict[str, Any]:
    """The ground truth of a defect: effect, joints, size, unit, the parameters that are comparable, seed."""
    parameters = _applied(robot, defect)[1]
    return {
        "effect": defect.effect,
        "joints": list(defect.joints),
        "size": float(defect.size),
        "unit": KINDS[defect.effect].unit,
        "parameters": {name: float(value) for name, value in parameters.items()},
        "seed": int(defect.seed),
    }


def drawn_defect(effect: str, arm: Arm, seed: int) -> Defect:
    """A defect of plausible size at a location that is drawn."""
    locations = _kind(effect).locations(arm)
    return Defect(
        effect, locations[stream(seed, f"place of {effect}").integers(len(locations))], KINDS[effect].plausible_on(arm), seed
    )


def _kind(effect: str) -> Kind:
    if effect not in KINDS:
        raise InputError("defect", "effect", repr(effect), ", ".join(KINDS))
    return KINDS[effect]


def _applied(robot: PhysicalRobot, defect: Defect) -> _Applied:
    kind = _kind(defect.effect)
    if defect.joints not in kind.locations(robot.arm):
        allowed = ", ".join(map(str, kind.locations(robot.arm)))
        raise InputError("defect", f"joints of {defect.effect}", str(defect.joints), allowed)
    if not 0.0 <= defect.size <= kind.largest:
        raise InputError("defect", f"size of {defect.effect}", f"{defect.size:g}", f"0 to {kind.largest:g} {kind.unit}")
    joints = [joint - 1 for joint in defect.joints]
    return kind.apply(robot, joints, defect.size, stream(defect.seed, f"details of {defect.effect}"))


def _nowhere(arm: Arm) -> list[_Location]:
    return [()]


def _each_joint(arm: Arm) -> list[_Location]:
    return [(joint,) for joint in range(1, arm.joints + 1)]


def _shoulder(arm: Arm) -> list[_Location]:
    """Where a gravity compensator can be, on arms that have one."""
    return [(2,)] if arm.compensated else []


def _turned_by(arm: Arm, masses: Iterable[Mass]) -> _Location:
    """Joints, from 1, that weights turn where the arm stands upright."""
    torque = usual_gravity_torque(arm, masses, (0.0, 0.0, -standard_gravity))
    return tuple(int(joint) + 1 for joint in np.flatnonzero(torque > _NO_TORQUE * torque.max()))


def _weighing_links(arm: Arm) -> list[tuple[int, _Location]]:
    """The upper arm and the forearm with the joints that their weight turns, list of (link, joints)."""
    found = []
    for (link,) in _each_link(arm):
        turned = _turned_by(arm, [Mass(link, 1.0)])
        # Of links that turn the same joints the first counts, and of all links two: the hand's weight is like a tool's.
        if turned and turned[-1] == link:
            found.append((link, turned))
    return found[:2]


def _weighed(arm: Arm) -> list[_Location]:
    everything, single = _turned_by(arm, on_stretches(declared_masses(arm), arm)), _weighing_links(arm)
    return list(dict.fromkeys([*(turned for _, turned in single), everything]))


def _each_link(arm: Arm) -> list[_Location]:
    lengths = [np.linalg.norm(stretch.vector_m) for stretch in arm.stretches]
    return [(link,) for link in range(1, arm.joints + 1) if lengths[link] > _SHORTEST_LINK_M]


def _warmed(arm: Arm) -> list[_Location]:
    """Along the whole arm, or across one of its links."""
    return [(), *_each_link(arm)]


def _each_pair(arm: Arm) -> list[_Location]:
    return list(combinations(range(1, arm.joints + 1), 2))


def _register(
    effect: str,
    unit: str,
    plausible: float,
    locations: _Locations,
    needs: tuple[str, ...] = (),
    largest: float = np.inf,
    scale: tuple[float, float] = (0.0, 0.0),
) -> Callable[[_Apply], _Apply]:
    def keep(apply: _Apply) -> _Apply:
        KINDS[effect] = Kind(unit, plausible, locations, apply, needs, largest, scale)
        return apply

    return keep


def _direction(draws: np.random.Generator) -> np.ndarray:
    vector = draws.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _named(start: str, vector: Iterable[float]) -> dict[str, float]:
    return {f"{start}{axis}": value for axis, value in zip(_AXES, vector, strict=True)}


def _with_gear(robot: PhysicalRobot, law: GearLaw) -> PhysicalRobot:
    return replace(robot, gears=(*robot.gears, law))


def _with_drive(robot: PhysicalRobot, law: DriveLaw) -> PhysicalRobot:
    return replace(robot, drives=(*robot.drives, law))


def _with_structure(robot: PhysicalRobot, **changes: Any) -> PhysicalRobot:
    return replace(robot, structure=replace(robot.structure, **changes))


def _usual_torque_Nm(robot: PhysicalRobot, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque on a joint as its gear is made for: that of the weight it carries, and of a usual load on top.

    Of a kilonewton at a heavy arm: 1500 N m by the arm's reach before the wrist, 450 N m by the tool's half metre behind it.
    """
    arm, structure = robot.arm, robot.structure
    load = (1500.0 if joint < arm.joints - 3 else 450.0) * arm.load_share * min(1.0, arm.reach_m / _HEAVY_REACH_M)
    return load + float(usual_gravity_torque(arm, structure.masses, structure.gravity_m_s2)[joint])


def _drawn_frame(robot: PhysicalRobot, error: str, draws: np.random.Generator) -> tuple[str, ...]:
    """In the flange's axes or not, beside the errors of the load cell that are so already."""
    return (*robot.cell.in_flange, error) if draws.integers(2) else robot.cell.in_flange


def _with_wrong_cell(robot: PhysicalRobot, error: str, draws: np.random.Generator, **changes: Any) -> PhysicalRobot:
    """The error in a frame that is drawn, of a cell at a location that is drawn."""
    frame, mount = _drawn_frame(robot, error, draws), ("pull", "flange")[draws.integers(2)]
    return replace(robot, cell=replace(robot.cell, in_flange=frame, mount=mount, **changes))


def _if_at_flange(robot: PhysicalRobot, parameters: dict[str, float]) -> dict[str, float]:
    """The catalogue's laws leave the moment as stated; those of a cell in the pull are not comparable."""
    return parameters if robot.cell.mount == "flange" else {}


# Geometry


@_register("joint_offset", "rad", 3e-4, _each_joint)
def _joint_offset(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    size = size * draws.choice([-1.0, 1.0])
    return _with_drive(robot, drives.ZeroOffset(joints[0], size)), {"offset": size}


@_register("link_geometry", "m", 3e-4, _each_joint)
def _link_geometry(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A wrong vector, and a wrong turn of as many milliradians as it has millimetres."""
    stretch, vector, turn = joints[0] + 1, size * _direction(draws), size * _direction(draws)
    structure = robot.structure
    changed = _with_structure(
        robot,
        wrong_vectors_m=structure.wrong_vectors_m | {stretch: tuple(vector)},
        wrong_turns=structure.wrong_turns | {stretch: tuple(turn)},
    )
    # The catalogue counts along the axes at the far end of the link.
    return changed, _named("d", robot.arm.stretches[stretch].rotation.T @ vector) | _named("r", turn)


@_register("tracker_scale", "1", 2e-5, _nowhere)
def _tracker_scale(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A wrong wavelength, at which the frame of the base was measured too."""
    return replace(robot, tracker=replace(robot.tracker, scale=size)), {"scale": size}


# Gravity


@_register("link_weight", "kg", 100.0, _weighed, scale=(0.0, 1.0))
def _link_weight(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Weight of the upper arm, which turns joint 2, of the forearm, which turns the elbow too, or of all links.

    By the joints that it turns: of one link beside its line, or of all as their masses are declared.
    """
    arm, structure = robot.arm, robot.structure
    one = dict((turned, link) for link, turned in _weighing_links(arm))
    turned = tuple(joint + 1 for joint in joints)
    if turned in one:
        along, aside = draws.uniform(0.25, 0.6), tuple(draws.uniform(-0.06, 0.06, 3))
        return _with_structure(robot, masses=(*structure.masses, Mass(one[turned], size, along, aside))), {}
    masses = on_stretches(declared_masses(arm), arm)
    total = sum(mass.mass_kg for mass in masses if mass.stretch > 1)
    more = tuple(replace(mass, mass_kg=size * mass.mass_kg / total) for mass in masses if mass.stretch > 1)
    return _with_structure(robot, masses=(*structure.masses, *more)), {}


@_register("payload", "kg", 25.0, _nowhere, scale=(0.0, 1.0))
def _payload(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    centre = 0.15 * _direction(draws)
    return _with_structure(robot, payload=Mass(robot.arm.joints, size, 1.0, tuple(centre))), {"mass": size} | _named(
        "moment_", size * centre
    )


@_register("compensator_torque", "N/m", 1e5, _shoulder)
def _compensator_torque(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A coil spring whose pull the controller does not know."""
    anchor = (-draws.uniform(0.25, 0.4), 0.0, -draws.uniform(0.1, 0.3))
    crank = (draws.uniform(0.12, 0.22), 0.0, draws.uniform(-0.08, 0.08))
    return _with_structure(robot, compensator=Compensator(anchor, crank, size, draws.uniform(0.2, 0.35))), {}


# Transmission


@_register("transmission_harmonic", "rad", 8e-5, _each_joint)
def _transmission_harmonic(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """An eccentric wheel that turns with the joint: an order of 1 or 2 but for creep, and half as much of its double."""
    order, phases = draws.choice([1, 2]) * draws.uniform(0.98, 1.02), draws.uniform(0, 2 * np.pi, 2)
    waves = ((order, size, phases[0]), (2 * order if order < 1.5 else order / 2, 0.5 * size, phases[1]))
    return _with_drive(robot, drives.TransmissionError(joints[0], waves)), {}


@_register("transmission_ratio", "rad/rad", 3e-4, _each_joint)
def _transmission_ratio(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Of the joint's own ratio, or what the joint before it turns along."""
    joint = joints[0]
    of = joint if joint == 0 else joint - draws.integers(2)
    size = size * draws.choice([-1.0, 1.0])
    return _with_drive(robot, drives.WrongRatio(joint, int(of), size)), {f"per_q{of + 1}": size}


@_register("bearing_runout", "m", 3e-5, _each_joint)
def _bearing_runout(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """The axis of a joint moves to and fro by `size`, once a turn across it and twice across both; so it wobbles at its edge.

    An axis that circled once with the joint, or against it, would be a link of other dimensions.
    """
    joint, phases = joints[0], draws.uniform(0, 2 * np.pi, 4)
    structure, number = robot.structure, joints[0] + 1
    tilt = structure.tilt | {number: structure.tilt.get(number, (0.0, 0.0))}
    changed = _with_structure(robot, loose=tuple({*structure.loose, number}), tilt=tilt)
    laws = []
    for which, order in enumerate((1, 2)):
        laws.append((f"shift{number}_{which}", drives.Runout(joint, order, size, phases[which])))
        laws.append((f"tilt{number}_{which}", drives.Runout(joint, order, size / _BEARING_M, phases[2 + which])))
    return replace(changed, offsets=(*robot.offsets, *laws)), {}


@_register("motor_eccentricity", "rad", 6e-5, _each_joint)
def _motor_eccentricity(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A wheel on the motor's shaft: once and twice a turn of the motor, which is no whole number of turns of the joint."""
    order, phases = robot.arm.gear_ratio[joints[0]], draws.uniform(0, 2 * np.pi, 2)
    waves = ((order, size, phases[0]), (2.0 * order, 0.4 * size, phases[1]))
    return _with_drive(robot, drives.TransmissionError(joints[0], waves)), {}


@_register("transmission_order", "rad", 8e-5, _each_joint)
def _transmission_order(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A planet or a cage: an order between two integers, and a quarter as much of its double.

    No higher than some twenty poses can show; `short_waves` are.
    """
    order, phases = draws.integers(2, 5) + draws.uniform(0.25, 0.75), draws.uniform(0, 2 * np.pi, 2)
    waves = ((order, size, phases[0]), (2.0 * order, 0.25 * size, phases[1]))
    return _with_drive(robot, drives.TransmissionError(joints[0], waves)), {}


# Elasticity


@_register("link_elasticity", "1/(N m^2)", 1e-7, _each_link, scale=(1.0, 0.0))
def _link_elasticity(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A tapered tube that also shears and stretches, as a thin-walled one of a quarter metre does."""
    bending, gyration = 1.0 / size, 0.25**2 / 8.0
    axial = bending / gyration
    tube = TaperedTube(bending, 0.77 * bending, axial, 0.5 * axial / 2.6, draws.uniform(0.1, 0.35))
    return _with_structure(robot, tubes=robot.structure.tubes | {joints[0] + 1: tube}), {}


@_register("joint_tilt", "rad/(N m)", 2e-7, _each_joint, scale=(1.0, 0.0))
def _joint_tilt(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    values = size * draws.uniform(0.4, 1.0, 2)
    across = [axis for axis, part in zip(_AXES, robot.arm.axes[joints[0]], strict=True) if abs(part) < 0.5]
    tilt = robot.structure.tilt | {joints[0] + 1: tuple(values)}
    return _with_structure(robot, tilt=tilt), {f"tilt_about_{axis}": v for axis, v in zip(across, values, strict=True)}


@_register("base_compliance", "rad/(N m)", 6e-8, _nowhere, scale=(1.0, 0.0))
def _base_compliance(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Anchor bolts: the two tilts and the two shifts differ a little."""
    uneven, horizontal, vertical = draws.uniform(0.85, 1.15, 4), 0.2 * size, 0.1 * size
    base = (horizontal * uneven[0], horizontal * uneven[1], vertical, size * uneven[2], size * uneven[3], 0.0)
    return _with_structure(robot, base=base), {"vertical": vertical}


@_register("cross_compliance", "rad/(N m)", 8e-8, _each_pair, scale=(1.0, 0.0))
def _cross_compliance(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    size = size * draws.choice([-1.0, 1.0])
    one, other = joints
    return _with_gear(robot, gears.Coupling((one, other), size)), {"compliance": size}


@_register("joint_dependent_stiffness", "1", 0.1, _each_joint, largest=0.8)
def _joint_dependent_stiffness(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """The stiffness, not the compliance, is a cosine."""
    joint = joints[0]
    law = gears.AngleDependentStiffness(joint, robot.compliance[joint], size, draws.uniform(0, 2 * np.pi), joint)
    return _with_gear(robot, law), {}


@_register("compensator_stiffness", "N/m", 3e6, _shoulder)
def _compensator_stiffness(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    joint = joints[0]
    anchor, crank, free = draws.uniform(0.3, 0.5), draws.uniform(0.15, 0.22), draws.uniform(0.15, 0.3)
    zero = draws.uniform(-np.pi, np.pi)
    return _with_gear(robot, gears.CompensatorStiffness(joint, robot.compliance[joint], size, anchor, crank, free, zero)), {}


@_register("flange_flexibility", "rad/(N m)", 2e-7, _nowhere, scale=(1.0, 0.0))
def _flange_flexibility(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A tool changer between flange and target: it turns in three directions, and shifts by a tenth of a metre's lever."""
    turns, shifts = size * draws.uniform(0.4, 1.0, 3), 0.01 * size * draws.uniform(0.4, 1.0, 3)
    flange = tuple(old + new for old, new in zip(robot.structure.flange or (0.0,) * 6, (*shifts, *turns), strict=True))
    return _with_structure(robot, flange=flange), _named("shift_", shifts) | _named("turn_", turns)


# Gearboxes


@_register("stiffening", "1", 0.3, _each_joint, largest=0.95)
def _stiffening(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """The compliance falls by shares of `size` at three torques."""
    joint = joints[0]
    starts = _usual_torque_Nm(robot, joint) * np.sort(draws.uniform(0.1, 0.8, 3))
    steps = tuple((start, size * robot.compliance[joint] / 3) for start in starts)
    return _with_gear(robot, gears.StepwiseStiffening(joint, steps)), {}


@_register("lost_motion", "rad", 7e-5, _each_joint)
def _lost_motion(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    closing = _usual_torque_Nm(robot, joints[0]) * draws.uniform(0.02, 0.1)
    return _with_gear(robot, gears.DeadBand(joints[0], size, closing)), {"half_play": size}


@_register("hysteresis", "rad", 5e-5, _each_joint, ("approach",))
def _hysteresis(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Under load part of the wound-up friction turns round, so that the mean half width is less than that at rest.

    The catalogue's half width is counted along the approach, and friction is against it.
    """
    torque = _usual_torque_Nm(robot, joints[0]) * draws.uniform(2.0, 6.0)
    return _with_gear(robot, gears.BoucWen(joints[0], size, torque)), {"half_width": -size}


# Load


@_register("force_scale", "1", 0.02, _nowhere, largest=0.1)
def _force_scale(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return replace(robot, cell=replace(robot.cell, scale=1.0 / (1.0 + size) - 1.0)), {"scale": size}


@_register("force_misalignment", "rad", 0.02, _nowhere)
def _force_misalignment(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    turn = size * _direction(draws)
    wrong = _with_wrong_cell(robot, "turn", draws, turn_rad=tuple(turn))
    return wrong, _if_at_flange(wrong, _named("about_", turn))


@_register("force_bias", "N", 20.0, _nowhere, scale=(0.0, 1.0))
def _force_bias(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """What is felt beyond what is shown is minus the bias of the display."""
    felt = size * _direction(draws)
    wrong = _with_wrong_cell(robot, "bias", draws, bias_N=tuple(-felt))
    return wrong, _if_at_flange(wrong, _named("along_", felt))


@_register("application_point", "m", 0.02, _nowhere)
def _application_point(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    shift, frame = size * _direction(draws), _drawn_frame(robot, "shift", draws)
    return replace(robot, cell=replace(robot.cell, shift_m=tuple(shift), in_flange=frame)), _named("shift_", shift)


# Drift


@_register("frame_drift", "m/h", 1e-4, _nowhere, ("time",))
def _frame_drift(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A stand that settles over hours, and so drifts less at the end than at the start."""
    drift = Drift(tuple(size * _direction(draws)), tuple(0.5 * size * _direction(draws)), draws.uniform(3.0, 8.0))
    return replace(robot, tracker=replace(robot.tracker, drift=drift)), {}


@_register("thermal_growth", "1/K", 1.2e-5, _nowhere, ("temperature",))
def _thermal_growth(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """The castings follow the thermometer with a lag, which the catalogue's law by temperature does not know."""
    return replace(robot, expansion_per_K=size), {}


@_register("setup_step", "m", 1e-3, _nowhere)
def _setup_step(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """The tracker's stand is knocked between two rows: a shift, and a turn about the stand of as much at three metres."""
    move = Move(draws.uniform(*_KNOCKED_S), tuple(size * _direction(draws)), tuple(size / 3.0 * _direction(draws)))
    return replace(robot, tracker=replace(robot.tracker, move=move)), {}


@_register("temperature_gradient", "1/K", 1.2e-5, _warmed, ("temperature",))
def _temperature_gradient(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Motors at the foot and a cold tip, beside what the arm grows on average; or a link that is warmer on one side."""
    arm, size = robot.arm, size * draws.choice([-1.0, 1.0])
    lengths = np.array([np.linalg.norm(stretch.vector_m) for stretch in arm.stretches])
    if not joints:
        share = np.linspace(1.0, -1.0, arm.joints + 1)
        mean = share @ lengths / lengths.sum()
        gradient = tuple(np.array(robot.gradient_per_K) + size * (share[[0, -1]] - mean))
        return replace(robot, gradient_per_K=gradient), {}
    link, about = joints[0] + 1, draws.uniform(0, 2 * np.pi)
    pieces, tubes = robot.structure.segments, {link: TaperedTube(np.inf, np.inf)} | robot.structure.tubes
    bend = size * lengths[link] / _LINK_M / pieces
    laws = tuple(
        (f"link{link}_{piece}_bend{which}", drives.WarmBend(bend * part, robot.warmth))
        for piece in range(pieces)
        for which, part in enumerate((np.cos(about), np.sin(about)))
    )
    return replace(_with_structure(robot, tubes=tubes), offsets=(*robot.offsets, *laws)), {}


@_register("nest_eccentricity", "m", 1e-4, _nowhere)
def _nest_eccentricity(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    turns = robot.arm.stretches[-1].rotation.T @ robot.arm.axes[-1]
    return replace(robot, nest=EccentricNest(size, int(np.argmax(np.abs(turns))))), {}


# Outside of the catalogue


@_register(OUTSIDE + "cable_pull", "rad/rad^2", 1e-4, lambda arm: [(j,) for j in range(3, arm.joints)])
def _cable_pull(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A hose wound by its joint and the one before pulls in proportion to the product of the two angles."""
    joint = joints[0]
    return _with_drive(robot, drives.CablePull(joint, (joint - 1, joint), size * draws.choice([-1.0, 1.0]))), {}


@_register(
    OUTSIDE + "cable_transmission", "rad/(N m)", 1e-7, lambda arm: [(j,) for j in range(2, arm.joints)], scale=(1.0, 0.0)
)
def _cable_transmission(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A joint driven by cables, which pass the pulley of the joint behind it."""
    winding = draws.uniform(0.4, 0.8) * draws.choice([-1.0, 1.0])
    return _with_gear(robot, gears.CableTransmission(joints[0], size, winding, joints[0] + 1)), {}


@_register(OUTSIDE + "asymmetric_gear", "rad/(N m)^2", 1e-10, _each_joint, scale=(1.0, -1.0))
def _asymmetric_gear(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return _with_gear(robot, gears.Asymmetric(joints[0], size * draws.choice([-1.0, 1.0]))), {}


@_register(OUTSIDE + "slipping_zero", "rad", 5e-5, _each_joint)
def _slipping_zero(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return _with_drive(robot, drives.SlippingZero(joints[0], size)), {}


@_register(OUTSIDE + "warm_softening", "1/K", 0.01, _each_joint)
def _warm_softening(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return _with_gear(robot, gears.WarmSoftening(joints[0], robot.compliance[joints[0]], size)), {}


@_register(OUTSIDE + "foreign_angle_stiffness", "1", 0.15, lambda arm: [(2,), (3,)], largest=0.8)
def _foreign_angle_stiffness(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A parallel rod: the stiffness of the shoulder depends on the angle of the elbow, or the other way round."""
    joint, other = joints[0], {1: 2, 2: 1}[joints[0]]
    law = gears.AngleDependentStiffness(joint, robot.compliance[joint], size, draws.uniform(0, 2 * np.pi), other)
    return _with_gear(robot, law), {}


@_register(OUTSIDE + "stiffening_link", "rad/(N m)^3", 1e-13, _each_link, scale=(1.0, -2.0))
def _stiffening_link(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A bolted link whose flanges open with the cube of the bending moment; without it the link is rigid."""
    stretch = joints[0] + 1
    rigid = TaperedTube(np.inf, np.inf)
    changed = _with_structure(robot, tubes=robot.structure.tubes | {stretch: rigid})
    pieces = robot.structure.segments
    laws = tuple((f"link{stretch}_{piece}_bend", lambda moment: size * moment**3 / pieces) for piece in range(pieces))
    return replace(changed, structure_laws=(*robot.structure_laws, *laws)), {}


@_register(OUTSIDE + "foot_slip", "m", 8e-5, _nowhere)
def _foot_slip(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """A foot between its bolts: it shifts by a clearance as soon as the push exceeds friction, and no further."""
    friction = draws.uniform(100.0, 300.0) * robot.arm.load_share
    changed = _with_structure(robot, base=(0.0,) * 6)

    def slip(push: np.ndarray) -> np.ndarray:
        return size * np.sign(push) * np.clip((np.abs(push) - friction) / friction, 0.0, 1.0)

    laws = (("base_x", slip), ("base_y", slip))
    return replace(changed, structure_laws=(*robot.structure_laws, *laws)), {}


@_register(OUTSIDE + "refraction", "1/m", 2e-6, _nowhere)
def _refraction(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return replace(robot, tracker=replace(robot.tracker, refraction_per_m=size)), {}


@_register(OUTSIDE + "cell_crosstalk", "1/N", 5e-5, _nowhere, scale=(0.0, -1.0))
def _cell_crosstalk(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    return replace(robot, cell=replace(robot.cell, crosstalk_per_N=size)), {}


@_register(OUTSIDE + "short_waves", "rad", 8e-5, _each_joint)
def _short_waves(robot: PhysicalRobot, joints: list[int], size: float, draws: np.random.Generator) -> _Applied:
    """Teeth of a motor's pinion: of orders far above what the poses of a campaign can resolve."""
    orders = draws.uniform(45.0, 120.0, 3)
    waves = tuple((order, size / np.sqrt(3), phase) for order, phase in zip(orders, draws.uniform(0, 6.28, 3), strict=True))
    return _with_drive(robot, drives.TransmissionError(joints[0], waves)), {}
