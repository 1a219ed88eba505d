"""Loads that a model does not have: weights, the torque of a compensator, and what a
force sensor shows that does not act.

Gravity is there without an external load and moves the robot; a wrench that is declared
for a task is right, so that no error of the sensor does.
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
    effect,
    small_form,
    turning_joints,
    waves,
)
from elastocal.effects.sizes import LOAD, RATED, REACH, SAG, TORQUE, Size

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

    # Change of force and moment (S, 3) by a unit of an error along or about a direction
    # (S, 3), of the wrench (S, 6).
    Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

_gravity = partial(effect, "gravity")
_sensor = partial(effect, "load", moves_robot=False)
DECLARED_WEIGHT = "declared_weight"
_LINKS = 2
_OFF_THE_LINE = "off the line"
# Of a centre of mass off the line of its link; and of a gripper, from the flange.
_OFF_M = 0.2
_LEVER_M = 0.2
# Links are as wide as a tenth of the arm is long (KUKA KR 270: 0.3 m of 2.7 m); motors
# and gears put the centre of a slender one so far off the line as well.
_WIDTH_OF_LENGTH = 0.1
_LEAST_OFF_M = 0.04
# A centre on its joint's axis is stated no better than as so far from it.
_LEAST_LEVER_M = 0.1
# Share of the moments that may be left unexplained where a pull acts at one place.
_OF_ONE_PLACE = 0.01
# Axes in which an error can be fixed, with the moments right, or with those that the
# wrong force makes at its lever: between flange and tool a sensor measures forces and
# moments; in the line of a pull, the force alone.
_PULL = " in the pull"
_FRAMES = [("base axes",), ("flange axes",)]
_AND_IN_PULL = [*_FRAMES, *((frame + _PULL,) for (frame,) in _FRAMES)]


def declared_weight(sites: Sites) -> Candidate:
    """Errors of all declared masses and first moments as one candidate, each with the
    prior of the robot file.

    No effect, for nothing is missing: the declared model has it where the robot file
    has masses. theta_i = c_i tau_i(q, m) is linear in the error of each mass and of its
    first moments m c, which are what statics identifies (Atkeson, An and Hollerbach
    1986); a mass takes its declared centre with it, so that both errors are independent
    before the data speak.
    """

    def law(around: Conditions) -> Displacements:
        return _by_joint(around.mass_torques * around.compliance)

    width = _WIDTH_OF_LENGTH * float(np.linalg.norm(sites.link_vectors_m, axis=1).sum())
    parameters: list[Parameter] = []
    for mass in sites.masses:
        error = mass.relative_std * mass.mass_kg
        # Of a centre that is known as well as its mass is, and lies anywhere in the
        # girth of its link (uniform distribution).
        of_girth = mass.mass_kg * max(_LEAST_OFF_M, width / 12**0.5)
        stated = error * max(float(np.linalg.norm(mass.centre_m)), _LEAST_LEVER_M)
        moment = float(np.hypot(stated, of_girth))
        parameters.append(
            Parameter(f"mass_error_of_link_{mass.link}", "kg", error, error)
        )
        parameters += [
            Parameter(
                f"moment_error_{axis}_of_link_{mass.link}", "kg m", stated, moment
            )
            for axis in "xyz"
        ]
    return Candidate(DECLARED_WEIGHT, "declared", (), "", tuple(parameters), law)


def _by_joint(turns: np.ndarray) -> Displacements:
    """Turns of the joints by each parameter, ndarray (P, S, n), without those joints
    that it does not turn."""
    moved = np.asarray(turns.any(axis=1))
    return [
        {joint: each[:, joint] for joint in np.flatnonzero(mine).tolist()}
        for each, mine in zip(turns, moved, strict=True)
    ]


def _sagging(
    around: Conditions, places: Iterable[tuple[int, int | None]]
) -> Displacements:
    """Turns of the joints by a kilogram, or a kilogram metre, at each of some places as
    of `Conditions.weight`."""
    return [
        dict(enumerate((around.weight(*place) * around.compliance).T))
        for place in places
    ]


@_gravity(
    "gravity sag",
    Size(
        "mass",
        1.5,
        "an arm weighs six times what it carries, a quarter of it at the end of a link",
        RATED,
    ),
    Size("mass of one joint", 1.5, "the same, by the joint's turn", SAG),
    detail_words={_OFF_THE_LINE: "centres of mass off the links' axes"},
    formula=r"\theta_i = c_i \sum_k m_k \tau_{ik}(q)",
)
def link_weight(entry: Effect, sites: Sites) -> Candidates:
    """Sag of the arm, or of one joint, under the weight of the links that it carries.

    theta_i = c_i sum_k m_k tau_ik(q), with theta_i in rad, c_i the compliance (rad/(N
    m)), m_k a mass at the far end of link k (kg) and tau_ik its torque on joint i (N
    m/kg). Given the compliances it is linear in masses and first moments (Atkeson et
    al. 1986), which turn all joints at once; of one joint alone, in the products with
    its compliance. A link's own mass m at its middle counts as m/2 at either end. Where
    the robot file declares masses, theirs are parameters already (`declared_weight`).
    Variants have first moments across the lines of links (kg m) too.
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
        axes = _moment_axes(sites, links, [joint])
        if axes:
            yield _sag_of_joint(entry, sites, joint, links, axes, _OFF_THE_LINE)


def _moment_axes(
    sites: Sites, links: Sequence[int], joints: Iterable[int]
) -> list[tuple[int, int]]:
    """List each link with each axis across its line along which a first moment turns
    one of some joints."""
    joints = list(joints)
    return [
        (link, axis)
        for link in links
        for axis in sites.transverse_axes(link)
        if any(sites.moment_turns(link, axis, joint) for joint in joints)
    ]


def _sag_of_arm(entry: Effect, sites: Sites, first: int) -> Candidates:
    """Masses that turn all joints at once: those behind the first joint that weight can
    turn."""
    carried = sites.carried_links(first)
    near = carried[:_LINKS]
    axes = _moment_axes(sites, near, range(sites.joints))
    variants: list[tuple[Sequence[int], Sequence[tuple[int, int]], str]] = [
        (near, (), "")
    ]
    if axes:
        variants.append((near, axes, _OFF_THE_LINE))
    if len(carried) > _LINKS:
        all_axes = _moment_axes(sites, carried, range(sites.joints))
        variants.append((carried, all_axes, "all links"))
    size = entry.size("mass", sites)
    for links, moment_axes, detail in variants:
        law = partial(_sagging, places=_mass_places(links, moment_axes))
        parameters = _mass_parameters(links, moment_axes, size, "", "{}")
        # Without a load the compliances are not identifiable, and nominal ones are far
        # off.
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
    """Masses that turn one joint, in the products with its compliance."""
    size = entry.size("mass of one joint", sites, joint)
    places = _mass_places(links, axes)
    return entry.of_joint(
        joint,
        _mass_parameters(links, axes, size, "compliance_times_", "rad {}/(N m)"),
        lambda around: [around.weight(*place)[:, joint] for place in places],
        detail=detail,
    )


def _mass_places(
    links: Sequence[int], axes: Sequence[tuple[int, int]]
) -> list[tuple[int, int | None]]:
    """Arguments of `Conditions.weight`: a mass at the end of each link, then a first
    moment along each axis."""
    return [*((link, None) for link in links), *axes]


def _mass_parameters(
    links: Sequence[int],
    axes: Sequence[tuple[int, int]],
    size: float,
    prefix: str,
    unit: str,
) -> list[Parameter]:
    """Parameters in the order of `_mass_places`; `unit` has a gap for kg or kg m."""
    masses = [
        Parameter(f"{prefix}mass_at_end_of_link_{link}", unit.format("kg"), size)
        for link in links
    ]
    moments = [
        Parameter(
            f"{prefix}moment_{'xyz'[axis]}_of_link_{link}",
            unit.format("kg m"),
            _OFF_M * size,
        )
        for link, axis in axes
    ]
    return [*masses, *moments]


@_gravity(
    "weight of the arm beyond its declared masses",
    Size(
        "share",
        0.3,
        "files made of drawings lack motors, cables and dress, a third of an arm's weight",
    ),
    formula=r"\theta_i = c_i \sum_k s_k m_k \tau_{ik}(q)",
)
def declared_masses(entry: Effect, sites: Sites) -> Candidates:
    """Declared masses that are farther off than the robot file says: all by one factor,
    or each by its own.

    theta_i = c_i sum_k s_k m_k tau_ik(q), with theta_i in rad, c_i the compliance
    (rad/(N m)), m_k the declared mass of link k (kg), tau_ik its torque on joint i (N
    m/kg) and s_k the share by which it is heavier, one for all links or each its own. A
    mass takes its declared centre with it. Without a load the compliances are free, and
    no factor of all masses is distinguishable from them.
    """
    bodies = [
        (number, mass)
        for number, mass in enumerate(sites.masses)
        if mass.link and mass.mass_kg
    ]
    if not bodies:
        return
    names = [f"share_of_link_{mass.link}_from_mass_{number}" for number, mass in bodies]
    places = [MASS_PARAMETERS * number for number, _ in bodies]
    kilograms = np.array([mass.mass_kg for _, mass in bodies])

    def law(around: Conditions, shares: np.ndarray) -> Displacements:
        return _by_joint(
            np.tensordot(shares * kilograms, around.mass_torques[places], 1)
            * around.compliance
        )

    ways = (
        ("all alike", ["share"], np.ones((1, len(bodies)))),
        ("each", names, np.eye(len(bodies))),
    )
    for detail, named, shares in ways:
        parameters = entry.parameters("share", named, "1", sites)
        turns = partial(law, shares=shares)
        yield entry.candidate(
            (), parameters, turns, {"external load"}, detail=detail, location_name="arm"
        )


# It hangs on the flange in tasks as in the campaign, until someone takes it off: that
# moves the robot.
@_gravity(
    "weight of an undeclared payload",
    Size("mass", 0.15, "a cable package or a forgotten gripper", RATED),
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} m g \\ m r \times g "
        r"\end{pmatrix}"
    ),
)
def payload(entry: Effect, sites: Sites) -> Candidates:
    """Weight at the flange that the model does not know: a tool, a cable package or an
    adapter that nobody declared.

    theta = diag(c) J^T (m g, m r x g), with theta the turns of the joints (rad), c
    their compliances (rad/(N m)), J the Jacobian of the end-effector, g gravity
    (m/s^2), m the mass (kg) and r its centre from there (m). Given the compliances it
    is linear in m and in the first moments m r along the axes of the end-effector (kg
    m) (Atkeson et al. 1986).
    """
    mass = entry.size("mass", sites)
    law = partial(_sagging, places=[(sites.joints, axis) for axis in (None, 0, 1, 2)])
    moments = [Parameter(f"moment_{axis}", "kg m", _LEVER_M * mass) for axis in "xyz"]
    # Where neither a load nor what the links weigh is known, what hangs on the flange
    # is not distinguishable from that.
    tool = entry.candidate(
        (), [Parameter("mass", "kg", mass), *moments], law, LOADED_JOINTS - {"load"}
    )
    # A mass alone is most of what a tool does.
    yield from (tool, small_form(tool, "mass", slice(1)))


def compensated_joint(sites: Sites) -> list[tuple[int]]:
    """Joint on which the gravity compensator acts, from 0; none where the robot file
    has none."""
    on = sites.compensator.joint if sites.compensator else 0
    return [(on - 1,)] if on and not sites.prismatic[on - 1] else []


def wave_parameters(
    entry: Effect, quantity: str, unit: str, sites: Sites, joint: int
) -> list[Parameter]:
    """Parameters of `waves` of orders 1 and 2, of which the latter are half as
    large."""
    each = [
        entry.parameters(
            quantity, [f"cos_{k}q", f"sin_{k}q"], unit, sites, joint, over=k
        )
        for k in (1, 2)
    ]
    return [parameter for order in each for parameter in order]


@_gravity(
    "torque of the gravity compensator",
    Size("turn", 0.3, "a compensator bears a third of the weight", TORQUE),
    at=compensated_joint,
    formula=(
        r"T = -\frac{dU}{dq} = K a L \left( 1 - \frac{s_0}{s} \right) \sin(\alpha "
        r"+ q), \quad s^2 = a^2 + L^2 + 2 a L \cos(\alpha + q)"
    ),
)
def compensator_torque(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Torque of a spring or gas gravity compensator on the shoulder: it bears part of
    the arm's weight, more in some poses.

    T = -dU/dq = K a L (1 - s0/s) sin(alpha + q), U = K (s - s0)^2 / 2, s^2 = a^2 + L^2
    + 2 a L cos(alpha + q),

    in N m, for a spring of stiffness K (N/m) and free length s0 (m) between a crank a
    on the joint and an anchor at the distance L (m) (Klimchik et al. 2013). For a short
    crank, a << L, it is a sine of q and of 2q with unknown phases, under the law of a
    gas cylinder too; the compliance of the joint turns it into theta = sum_k u_k cos(k
    q) + v_k sin(k q), k = 1, 2, in rad.
    """
    parameters = wave_parameters(entry, "turn", "rad", sites, joint)
    whole = entry.of_joint(
        joint, parameters, lambda around: waves(around.joint_angles[:, joint], 1, 2)
    )
    yield from (whole, small_form(whole, "first order", slice(2)))


def _turned(
    around: Conditions, changes: Iterable[Sequence[np.ndarray]]
) -> Displacements:
    """Turns of the joints by each of some changes of force and moment (S, 3) at the
    last measuring point."""
    joints = slice(len(around.compliance))
    torques = [
        around.load_by(np.concatenate(change, axis=1), joints) for change in changes
    ]
    return [dict(enumerate((each * around.compliance).T)) for each in torques]


def _wrong(
    entry: Effect, parameters: tuple[Parameter, ...], frame: str, change: Change
) -> Candidate:
    """Candidate of a wrench that is wrong by ``change(direction, wrench)`` for each of
    the axes of a frame."""

    def law(around: Conditions) -> Displacements:
        wrench = around.wrench
        rotation = np.moveaxis(around.motion.rotation[0], -1, 0)
        fixed = np.broadcast_to(np.eye(3), rotation.shape)
        changed = [
            change(axis, wrench)
            for axis in np.moveaxis(
                rotation if frame.startswith("flange") else fixed, -1, 0
            )
        ]
        if frame.endswith(_PULL):
            lever = lever_of_pull(wrench, rotation)
            changed = [(force, np.cross(lever, force)) for force, _ in changed]
        return _turned(around, changed)

    return entry.candidate((), parameters, law, LOADED_JOINTS, detail=frame)


def lever_of_pull(wrench: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Where a pull acts: the one place, in the flange or in base axes, about which
    forces make the moments (least squares).

    `wrench` (S, 6): at a point of the flange, base axes. `rotation` (S, 3, 3): of the
    flange. Returns (S, 3): from the point of the wrench, m, base axes; zero where no
    place explains the moments.
    """
    for axes in (rotation, np.broadcast_to(np.eye(3), rotation.shape)):
        force, moment = (
            np.einsum("sji,sj->si", axes, part)
            for part in (wrench[:, :3], wrench[:, 3:])
        )
        # r x F = -[F] r.
        rows = -np.cross(force[:, :, None], np.eye(3)[None], axis=1).reshape(-1, 3)
        place = np.linalg.lstsq(rows, moment.ravel(), rcond=None)[0]
        if np.linalg.norm(
            rows @ place - moment.ravel()
        ) <= _OF_ONE_PLACE * np.linalg.norm(moment):
            return axes @ place
    return np.zeros((len(wrench), 3))


@_sensor(
    "misalignment of the force sensor",
    Size("turn", 0.02, "a sensor mounted by eye: a degree"),
    at=lambda sites: _AND_IN_PULL,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} \varphi \times F \\ 0 "
        r"\end{pmatrix} \quad \text{or} \quad \mathrm{diag}(c)\, J^{T} "
        r"\begin{pmatrix} \varphi \times F \\ r \times (\varphi \times F) "
        r"\end{pmatrix}"
    ),
)
def force_misalignment(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor that is mounted askew: it shows the right force in a wrong
    direction.

    theta = diag(c) J^T (phi x F, 0), or diag(c) J^T (phi x F, r x (phi x F)) in a pull,

    with theta the turns of the joints (rad), c their compliances (rad/(N m)), J the
    Jacobian of the loaded point, F the recorded force (N) and phi the small angle from
    it to the one that acts (rad), fixed in base axes, or in the flange where the sensor
    turns with the tool. A sensor in the line of a pull measures the force alone, so
    that the moment about its lever r (m) is wrong, too; elsewhere the moments are as
    recorded. Derived here: a small turn adds phi x F, and an error dw of the wrench
    loads by J^T dw.
    """
    parameters = entry.parameters(
        "turn", [f"about_{axis}" for axis in "xyz"], "rad", sites
    )
    yield _wrong(
        entry,
        parameters,
        frame,
        lambda axis, wrench: (np.cross(axis, wrench[:, :3]), np.zeros_like(axis)),
    )


@_sensor(
    "zero error of the force sensor",
    Size("force", 0.01, "accuracy class of load cells that suit the arm", LOAD),
    at=lambda sites: _AND_IN_PULL,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} b \\ 0 \end{pmatrix} "
        r"\quad \text{or} \quad \mathrm{diag}(c)\, J^{T} \begin{pmatrix} b \\ r "
        r"\times b \end{pmatrix}"
    ),
)
def force_bias(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force sensor that shows a force where there is none: its zero was not set
    before the pull, or has moved since.

    theta = diag(c) J^T (b, 0) wherever a load is recorded, or (b, r x b) in a pull with
    the lever r (m); theta are the turns of the joints (rad), c their compliances
    (rad/(N m)), J the Jacobian of the loaded point, and b the force that acts beyond
    the recorded one (N), which is minus what the sensor shows at zero. It is fixed in
    base axes, or in the flange where the sensor turns with the tool.
    """
    parameters = entry.parameters(
        "force", [f"along_{axis}" for axis in "xyz"], "N", sites
    )
    yield _wrong(
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
    Size("shift", 0.01, "a hook or a screw beside the point that was meant", REACH),
    at=lambda sites: _FRAMES,
    formula=(
        r"\theta = \mathrm{diag}(c)\, J^{T} \begin{pmatrix} 0 \\ \delta r \times "
        r"F \end{pmatrix}"
    ),
)
def application_point(entry: Effect, sites: Sites, frame: str) -> Candidates:
    """A force that acts elsewhere than was recorded: the pull or the weight is fixed to
    the tool at another place.

    theta = diag(c) J^T (0, dr x F), with theta the turns of the joints (rad), c their
    compliances (rad/(N m)), J the Jacobian of the loaded point, F the force (N) and dr
    the shift of its point of application (m), fixed in base axes, or in the flange
    where the load hangs on the tool. Derived here: a force that is moved by dr has the
    further moment dr x F.
    """
    parameters = entry.parameters(
        "shift", [f"shift_{axis}" for axis in "xyz"], "m", sites
    )
    yield _wrong(
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
    """A force sensor that shows too much or too little: its sensitivity differs from
    the one of its calibration.

    theta = diag(c) J^T (s w), with theta the turns of the joints (rad), c their
    compliances (rad/(N m)), J the Jacobian of the loaded point, w the recorded wrench
    (N, N m) and s the share by which the one that acts is larger. Where all compliances
    are identified and no declared masses load the joints it is exactly an alias of
    them, so that only a reference weight can find it.
    """
    scale = entry.parameters("scale", ["scale"], "1", sites)
    yield entry.candidate(
        (),
        scale,
        lambda around: _turned(around, [np.split(around.wrench, 2, axis=1)]),
        LOADED_JOINTS,
    )
