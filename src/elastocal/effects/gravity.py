"""Loads that a model lacks: weights, the torque of a compensator, and errors of the force
sensor.

Gravity moves the robot even without an external load. Errors of the force sensor do not
move the robot in its tasks, because the wrench that is declared for a task is right.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.conditions import MASS_PARAMETERS
from elastocal.effects.protocol import (
    LOADED_JOINTS,
    Candidate,
    Parameter,
    declare_with_prior,
    effect,
    small_form,
    turning_joints,
    waves,
)
from elastocal.effects.sizes import (
    LOAD,
    RATED,
    REACH,
    SAG,
    TORQUE,
    Size,
    link_width_m,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

    # From a direction (S, 3) and the wrench (S, 6): the change of force and moment (S, 3)
    # per unit of an error along or about the direction.
    Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

_gravity = partial(effect, "gravity")
_sensor = partial(effect, "load", moves_robot=False)
DECLARED_WEIGHT = "declared_weight"
# Number of links behind a joint whose masses the smaller variants have.
_LINKS = 2
_OFF_THE_LINE = "off the line"
# Plausible distance of a centre of mass from the line of its link, and of the centre of a
# gripper from the flange.
_CENTRE_OFFSET_M = 0.2
_GRIPPER_LEVER_M = 0.2
# Lower bound on the standard deviation of a centre of mass across its link: motors and
# gears shift the centre of a slender link this far.
_LEAST_CENTRE_STD_M = 0.04
# Lower bound on the distance of a declared centre from its joint axis, of which its error
# is a share.
_LEAST_LEVER_M = 0.1
# Upper bound on the share of the moments that a pull at one point leaves unexplained.
_UNEXPLAINED_MOMENTS = 0.01
# Axes in which the error of a sensor is constant. A sensor between flange and tool measures
# forces and moments, so that the moments are right. A sensor in the line of a pull measures
# the force alone, so that the moments have the error of the force at its lever.
_PULL = " in the pull"
_FLANGE = "flange axes"
_FRAMES = [("base axes",), (_FLANGE,)]
_AND_IN_PULL = [*_FRAMES, *((frame + _PULL,) for (frame,) in _FRAMES)]


def declared_weight(sites: Sites) -> Candidate:
    """Make one candidate of the errors of all declared masses and first moments, each with
    the prior of the robot file.

    It is not an effect of the catalogue: the declared model contains it if the robot file
    has masses. theta_i = c_i tau_i(q, m) is linear in the error of each mass and of its
    first moments m c, which statics can identify (Atkeson, An and Hollerbach 1986). A
    change of a mass keeps its declared centre, so that the priors of both errors are
    independent.
    """

    def law(conditions: Conditions) -> Displacements:
        return _list_by_joint(conditions.mass_torques, conditions.compliance)

    width = link_width_m(sites)
    parameters: list[Parameter] = []
    for mass in sites.masses:
        error = mass.relative_std * mass.mass_kg
        # The distance of the centre is known as well as the mass. Across the link, the
        # centre may lie anywhere within its width (uniform distribution).
        across = mass.mass_kg * max(_LEAST_CENTRE_STD_M, width / 12**0.5)
        along = error * max(float(np.linalg.norm(mass.centre_m)), _LEAST_LEVER_M)
        moment_std = float(np.hypot(along, across))
        parameters.append(
            Parameter(
                f"mass_error_of_link_{mass.link}",
                "kg",
                error,
                error,
                lowest=-mass.mass_kg,
            )
        )
        parameters += [
            Parameter(
                f"moment_error_{axis}_of_link_{mass.link}", "kg m", along, moment_std
            )
            for axis in "xyz"
        ]
    return Candidate(DECLARED_WEIGHT, "declared", (), "", tuple(parameters), law)


def declared_application_point(sites: Sites, std_m: float) -> Candidate:
    """Make one candidate of the error of the declared point at which the load acts.

    It is the catalogue's `application_point` in flange axes, where hooks and weights are
    fixed, with the prior of a campaign. The declared model contains it if the campaign
    has loads. It belongs to the measurements, so that tasks do not feel it.

    Parameters
    ----------
    sites : sites of the robot.
    std_m : standard deviation of each coordinate of the point, m.
    """
    on_flange = next(
        candidate
        for candidate in application_point.candidates(sites)
        if candidate.detail == _FLANGE
    )
    return declare_with_prior(
        on_flange, "declared_application_point", [std_m] * 3, of_setup=True
    )


def _list_by_joint(torques: np.ndarray, compliance: np.ndarray) -> Displacements:
    """List the rotations of the joints by the torques (P, S, n) per unit of each
    parameter, without the joints that a parameter does not load.

    A joint that is loaded and rigid stays in the list, because its compliance may change
    from step to step.
    """
    displacements = []
    for torque in torques:
        joints = np.flatnonzero(torque.any(axis=0)).tolist()
        displacements.append(
            {joint: compliance[joint] * torque[:, joint] for joint in joints}
        )
    return displacements


def _compute_sag(
    conditions: Conditions, mass_locations: Iterable[tuple[int, int | None]]
) -> Displacements:
    """Compute the rotations of the joints per kilogram, or kilogram metre, at each place,
    which are arguments of `Conditions.weight`."""
    return [
        dict(enumerate((conditions.weight(*mass_location) * conditions.compliance).T))
        for mass_location in mass_locations
    ]


@_gravity(
    "gravity sag",
    Size(
        "mass",
        1.5,
        "an arm weighs six times its payload, a quarter of it at the end of a link",
        RATED,
    ),
    Size("mass of one joint", 1.5, "the same, as a rotation of the joint", SAG),
    detail_words={_OFF_THE_LINE: "centres of mass off the links' axes"},
    formula=r"\theta_i = c_i \sum_k m_k \tau_{ik}(q)",
)
def link_weight(entry: Effect, sites: Sites) -> Candidates:
    """Sag of the arm, or of one joint, under the weight of the links that it carries.

    theta_i = c_i sum_k m_k tau_ik(q), with theta_i in rad, c_i the compliance (rad/(N
    m)), m_k a mass at the far end of link k (kg) and tau_ik its torque on joint i (N
    m/kg). Given the compliances, the sag of the arm is linear in masses and first moments
    (Atkeson et al. 1986). The sag of one joint alone is linear in their products with its
    compliance. A link's own mass m at its middle counts as m/2 at either end.
    Masses at the ends and first moments of all bodies span the base parameters of gravity
    (Gautier 1991); those that the measurements do not separate share their prior. A body
    between joints that coincide has no length, hence first moments along all axes. If the robot
    file declares masses, their errors are parameters already (`declared_weight`). Variants
    also have first moments across the lines of links (kg m).
    """
    if sites.masses:
        return
    joints = [joint for (joint,) in turning_joints(sites) if sites.carried_links(joint)]
    if joints:
        yield from _sag_of_arm(entry, sites, joints[0])
    near = {joint: sites.carried_links(joint)[:_LINKS] for joint in joints}
    for joint, links in near.items():
        yield _sag_of_joint(entry, sites, joint, links)
    for joint, links in near.items():
        bodies = _list_bodies(sites, joint, links)
        axes = _moment_axes(sites, bodies, [joint])
        if axes:
            yield _sag_of_joint(entry, sites, joint, links, axes, _OFF_THE_LINE)


def _list_bodies(sites: Sites, joint: int, links: Sequence[int]) -> list[int]:
    """List links behind a joint, from 0, and the bodies without length between them."""
    return [
        body
        for body in range(joint + 1, links[-1] + 1)
        if body in links or not sites.has_length(body)
    ]


def _moment_axes(
    sites: Sites, links: Sequence[int], joints: Iterable[int]
) -> list[tuple[int, int]]:
    """List each link with each axis across its line along which a first moment loads one
    of the joints; a link without length has no line, so that all its axes count."""
    axes = [
        (link, axis)
        for link in links
        for axis in (
            sites.transverse_axes(link) if sites.has_length(link) else range(3)
        )
    ]
    loading = {
        (link, axis)
        for joint in joints
        for link, axis in axes
        if sites.moment_turns(link, axis, joint)
    }
    return [axis_of_link for axis_of_link in axes if axis_of_link in loading]


def _sag_of_arm(entry: Effect, sites: Sites, first: int) -> Candidates:
    """List the candidates of masses that load all joints: the masses behind the first
    joint that weight can rotate."""
    carried = sites.carried_links(first)
    near = carried[:_LINKS]
    near_bodies = _list_bodies(sites, first, near)
    axes = _moment_axes(sites, near_bodies, range(sites.joints))
    variants: list[tuple[Sequence[int], Sequence[tuple[int, int]], str]] = [
        (near, (), "")
    ]
    if axes:
        variants.append((near, axes, _OFF_THE_LINE))
    if len(carried) > _LINKS:
        bodies = _list_bodies(sites, first, [*carried, sites.joints])
        all_axes = _moment_axes(sites, bodies, range(sites.joints))
        variants.append((carried, all_axes, "all links"))
    size = entry.size("mass", sites)
    for links, moment_axes, detail in variants:
        law = partial(_compute_sag, mass_locations=_mass_locations(links, moment_axes))
        parameters = _mass_parameters(links, moment_axes, size, "", "{}")
        # Without a load the compliances are not identifiable, and nominal compliances have
        # large errors.
        needs = {"external load"}
        yield entry.candidate(
            (), parameters, law, needs, detail=detail, location_name="arm"
        )


def _sag_of_joint(
    entry: Effect,
    sites: Sites,
    joint: int,
    links: Sequence[int],
    axes: Sequence[tuple[int, int]] = (),
    detail: str = "",
) -> Candidate:
    """Make the candidate of masses that load one joint, as products with its
    compliance."""
    size = entry.size("mass of one joint", sites, joint)
    mass_locations = _mass_locations(links, axes)
    return entry.of_joint(
        joint,
        _mass_parameters(links, axes, size, "compliance_times_", "rad {}/(N m)"),
        lambda conditions: [
            conditions.weight(*mass_location)[:, joint]
            for mass_location in mass_locations
        ],
        detail=detail,
    )


def _mass_locations(
    links: Sequence[int], axes: Sequence[tuple[int, int]]
) -> list[tuple[int, int | None]]:
    """List arguments of `Conditions.weight`: a mass at the end of each link, then a first
    moment along each axis."""
    return [*((link, None) for link in links), *axes]


def _mass_parameters(
    links: Sequence[int],
    axes: Sequence[tuple[int, int]],
    size: float,
    prefix: str,
    unit: str,
) -> list[Parameter]:
    """Make parameters in the order of `_mass_locations`; `unit` is a format for kg or
    kg m."""
    masses = [
        Parameter(f"{prefix}mass_at_end_of_link_{link}", unit.format("kg"), size)
        for link in links
    ]
    moments = [
        Parameter(
            f"{prefix}moment_{'xyz'[axis]}_of_link_{link}",
            unit.format("kg m"),
            _CENTRE_OFFSET_M * size,
        )
        for link, axis in axes
    ]
    return [*masses, *moments]


@_gravity(
    "weight of the arm beyond its declared masses",
    Size(
        "share",
        0.3,
        "files from drawings lack motors, cables and hoses, a third of the arm",
    ),
    formula=r"\theta_i = c_i \sum_k s_k m_k \tau_{ik}(q)",
)
def declared_masses(entry: Effect, sites: Sites) -> Candidates:
    """Declared masses with larger errors than the robot file states: one factor for all
    masses, or one for each.

    theta_i = c_i sum_k s_k m_k tau_ik(q), with theta_i in rad, c_i the compliance
    (rad/(N m)), m_k the declared mass of link k (kg), tau_ik its torque on joint i (N
    m/kg) and s_k the share by which it is heavier, one for all links or one for each. A
    change of a mass keeps its declared centre. Without a load the compliances are
    unknown, and a factor of all masses cannot be distinguished from them.
    """
    bodies = [
        (number, mass)
        for number, mass in enumerate(sites.masses)
        if mass.link and mass.mass_kg
    ]
    if not bodies:
        return
    indices = [MASS_PARAMETERS * number for number, _ in bodies]
    masses_kg = np.array([mass.mass_kg for _, mass in bodies])

    def law(conditions: Conditions, shares: np.ndarray) -> Displacements:
        torques = np.tensordot(shares * masses_kg, conditions.mass_torques[indices], 1)
        return _list_by_joint(torques, conditions.compliance)

    names = [f"share_of_link_{mass.link}_from_mass_{number}" for number, mass in bodies]
    variants = (
        ("all alike", ["share"], np.ones((1, len(bodies)))),
        ("each", names, np.eye(len(bodies))),
    )
    for detail, parameter_names, shares in variants:
        yield entry.candidate(
            (),
            entry.parameters("share", parameter_names, "1", sites),
            partial(law, shares=shares),
            {"external load"},
            detail=detail,
            location_name="arm",
        )


# The payload stays on the flange in tasks, so that it moves the robot.
@_gravity(
    "weight of an undeclared payload",
    Size("mass", 0.15, "a cable package or a forgotten gripper", RATED, 1),
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} m g \\ m r \times g "
        r"\end{pmatrix}"
    ),
)
def payload(entry: Effect, sites: Sites) -> Candidates:
    """Weight at the flange that the model lacks: an undeclared tool, cable package or
    adapter.

    theta = diag(c) J^T (m g, m r x g), with theta the rotations of the joints (rad), c
    their compliances (rad/(N m)), J the Jacobian of the end-effector, g gravity
    (m/s^2), m the mass (kg) and r its centre from the end-effector (m). Given the
    compliances it is linear in m and in the first moments m r along the axes of the
    end-effector (kg m) (Atkeson et al. 1986).
    """
    mass = entry.size("mass", sites)
    law = partial(
        _compute_sag, mass_locations=[(sites.joints, axis) for axis in (None, 0, 1, 2)]
    )
    moments = [
        Parameter(f"moment_{axis}", "kg m", _GRIPPER_LEVER_M * mass) for axis in "xyz"
    ]
    # A payload can only be distinguished from the weight of the links if that weight or a
    # load is known.
    tool = entry.candidate(
        (),
        [Parameter("mass", "kg", mass, sign=1), *moments],
        law,
        LOADED_JOINTS - {"load"},
    )
    yield tool
    # The mass alone causes most of the displacement.
    yield small_form(tool, "mass", slice(1))


def compensated_joint(sites: Sites) -> list[tuple[int]]:
    """List the revolute joint on which a gravity compensator acts, from 0, if the robot
    file has one."""
    if not sites.compensator or not sites.compensator.joint:
        return []
    joint = sites.compensator.joint - 1
    return [] if sites.prismatic[joint] else [(joint,)]


def wave_parameters(
    entry: Effect, quantity: str, unit: str, sites: Sites, joint: int
) -> list[Parameter]:
    """Make the parameters of `waves` of orders 1 and 2; those of order 2 are half as
    large."""
    parameters: list[Parameter] = []
    for order in (1, 2):
        names = [f"cos_{order}q", f"sin_{order}q"]
        parameters += entry.parameters(quantity, names, unit, sites, joint, over=order)
    return parameters


@_gravity(
    "torque of the gravity compensator",
    Size("turn", 0.3, "a compensator carries a third of the weight", TORQUE),
    at=compensated_joint,
    formula=(
        r"T = -\frac{dU}{dq} = K a L \left( 1 - \frac{s_0}{s} \right) \sin(\alpha "
        r"+ q), \quad s^2 = a^2 + L^2 + 2 a L \cos(\alpha + q)"
    ),
)
def compensator_torque(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Torque of a spring or gas gravity compensator on the shoulder, which carries part of
    the weight of the arm, more in some poses.

    T = -dU/dq = K a L (1 - s0/s) sin(alpha + q), U = K (s - s0)^2 / 2, s^2 = a^2 + L^2
    + 2 a L cos(alpha + q),

    in N m, for a spring of stiffness K (N/m) and free length s0 (m) between a crank a
    on the joint and an anchor at the distance L (m) (Klimchik et al. 2013). For a short
    crank, a << L, it is a sum of sines of q and 2q with unknown phases, also for a gas
    cylinder. The compliance of the joint turns it into theta = sum_k u_k cos(k q) + v_k
    sin(k q), k = 1, 2, in rad.
    """
    parameters = wave_parameters(entry, "turn", "rad", sites, joint)
    whole = entry.of_joint(
        joint,
        parameters,
        lambda conditions: waves(conditions.joint_angles[:, joint], 1, 2),
    )
    yield whole
    yield small_form(whole, "first order", slice(2))


def _rotate_joints(conditions: Conditions, wrench: np.ndarray) -> dict[int, np.ndarray]:
    """Compute the rotations of the joints by a wrench (S, 6) at the last measuring
    point."""
    torques = conditions.load_by(wrench, slice(len(conditions.compliance)))
    return dict(enumerate((torques * conditions.compliance).T))


def _make_sensor_error(
    entry: Effect, parameters: tuple[Parameter, ...], frame: str, change: Change
) -> Candidate:
    """Make the candidate of a wrench with the error ``change(direction, wrench)`` for
    each axis of a frame."""

    def law(conditions: Conditions) -> Displacements:
        wrench = conditions.wrench
        rotation = np.moveaxis(conditions.motion.rotation[0], -1, 0)
        axes = np.broadcast_to(np.eye(3), rotation.shape)
        if frame.startswith("flange"):
            axes = rotation
        in_pull = frame.endswith(_PULL)
        lever = find_lever_of_pull(wrench, rotation) if in_pull else 0.0
        displacements = []
        for axis in range(3):
            force, moment = change(axes[..., axis], wrench)
            if in_pull:
                moment = np.cross(lever, force)
            error = np.concatenate([force, moment], axis=1)
            displacements.append(_rotate_joints(conditions, error))
        return displacements

    return entry.candidate((), parameters, law, LOADED_JOINTS, detail=frame)


def find_lever_of_pull(wrench: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Find the point at which a pull acts: the point, constant in flange or base axes,
    about which the forces have the moments (least squares).

    Parameters
    ----------
    wrench : at a point of the flange, (S, 6), base axes
    rotation : of the flange, (S, 3, 3)

    Returns
    -------
    Vectors from the point of the wrench, (S, 3), m, base axes; zero if no point explains
    the moments.
    """
    for axes in (rotation, np.broadcast_to(np.eye(3), rotation.shape)):
        force = np.einsum("sji,sj->si", axes, wrench[:, :3])
        moment = np.einsum("sji,sj->si", axes, wrench[:, 3:]).ravel()
        # r x F = -[F] r.
        rows = -np.cross(force[:, :, None], np.eye(3)[None], axis=1).reshape(-1, 3)
        lever = np.linalg.lstsq(rows, moment, rcond=None)[0]
        unexplained = np.linalg.norm(rows @ lever - moment)
        if unexplained <= _UNEXPLAINED_MOMENTS * np.linalg.norm(moment):
            return axes @ lever
    return np.zeros((len(wrench), 3))


@_sensor(
    "misalignment of the force sensor",
    Size("turn", 0.02, "a sensor that was aligned by eye, to a degree"),
    at=lambda sites: _AND_IN_PULL,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} \varphi \times F \\ 0 "
        r"\end{pmatrix} \quad \text{or} \quad \mathrm{diag}(c)\, J^{T} "
        r"\begin{pmatrix} \varphi \times F \\ r \times (\varphi \times F) "
        r"\end{pmatrix}"
    ),
)
def force_misalignment(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor that is mounted at an angle: it shows the right force in a wrong
    direction.

    theta = diag(c) J^T (phi x F, 0), or diag(c) J^T (phi x F, r x (phi x F)) in a pull,

    with theta the rotations of the joints (rad), c their compliances (rad/(N m)), J the
    Jacobian of the loaded point, F the recorded force (N) and phi the small rotation from
    it to the acting force (rad), constant in base axes, or in flange axes if the sensor
    moves with the tool. A sensor in the line of a pull measures the force alone, so that
    the moment about its lever r (m) is wrong, too; otherwise the moments are as recorded.
    Derived here: a small rotation adds phi x F, and an error dw of the wrench loads the
    joints by J^T dw.
    """
    parameters = entry.parameters(
        "turn", [f"about_{axis}" for axis in "xyz"], "rad", sites
    )
    yield _make_sensor_error(
        entry,
        parameters,
        frame,
        lambda axis, wrench: (np.cross(axis, wrench[:, :3]), np.zeros_like(axis)),
    )


@_sensor(
    "zero error of the force sensor",
    Size("force", 0.01, "accuracy class of load cells for the rated load", LOAD),
    at=lambda sites: _AND_IN_PULL,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} b \\ 0 \end{pmatrix} "
        r"\quad \text{or} \quad \mathrm{diag}(c)\, J^{T} \begin{pmatrix} b \\ r "
        r"\times b \end{pmatrix}"
    ),
)
def force_bias(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor with a zero error: its zero was not set before the pull, or has
    drifted since.

    theta = diag(c) J^T (b, 0) in all states with a recorded load, or (b, r x b) in a pull
    with the lever r (m); theta are the rotations of the joints (rad), c their compliances
    (rad/(N m)), J the Jacobian of the loaded point, and b the acting force minus the
    recorded force (N), which is minus the reading of the unloaded sensor. It is constant
    in base axes, or in flange axes if the sensor moves with the tool.
    """
    parameters = entry.parameters(
        "force", [f"along_{axis}" for axis in "xyz"], "N", sites
    )
    yield _make_sensor_error(
        entry,
        parameters,
        frame,
        lambda axis, wrench: (
            axis * wrench.any(axis=1, keepdims=True),
            np.zeros_like(axis),
        ),
    )


@_sensor(
    "wrong load application point",
    Size("shift", 0.01, "a hook or a screw beside the intended point", REACH),
    at=lambda sites: _FRAMES,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} 0 \\ \delta r \times "
        r"F \end{pmatrix}"
    ),
)
def application_point(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force that acts at another point than recorded: the pull or the weight is attached
    to the tool elsewhere.

    theta = diag(c) J^T (0, dr x F), with theta the rotations of the joints (rad), c their
    compliances (rad/(N m)), J the Jacobian of the loaded point, F the force (N) and dr
    the shift of its point of application (m), constant in base axes, or in flange axes if
    the load hangs on the tool. Derived here: a force that is shifted by dr has the
    additional moment dr x F.
    """
    parameters = entry.parameters(
        "shift", [f"shift_{axis}" for axis in "xyz"], "m", sites
    )
    yield _make_sensor_error(
        entry,
        parameters,
        frame,
        lambda axis, wrench: (np.zeros_like(axis), np.cross(axis, wrench[:, :3])),
    )


@_sensor(
    "scale error of the force sensor",
    Size("scale", 0.02, "a load cell that was calibrated long ago"),
    formula=r"\theta = \mathrm{diag}(c)\, J^{T} (s\, w)",
)
def force_scale(entry: Effect, sites: Sites) -> Candidates:
    """A force sensor that shows too much or too little, because its sensitivity has changed
    since its calibration.

    theta = diag(c) J^T (s w), with theta the rotations of the joints (rad), c their
    compliances (rad/(N m)), J the Jacobian of the loaded point, w the recorded wrench
    (N, N m) and s the share by which the acting wrench is larger. If all compliances are
    identified and no declared masses load the joints, the effect cannot be distinguished
    from them; then only a reference weight can reveal it.
    """
    scale = entry.parameters("scale", ["scale"], "1", sites)
    yield entry.candidate(
        (),
        scale,
        lambda conditions: [_rotate_joints(conditions, conditions.wrench)],
        LOADED_JOINTS,
    )
