"""Elastic: effects in proportion to the load."""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.gravity import compensated_joint, wave_parameters
from elastocal.effects.protocol import (
    LOADED_JOINTS,
    Candidate,
    Parameter,
    Shape,
    effect,
    every_joint,
    load_behind,
    small_form,
    turning_joints,
    waves,
)
from elastocal.effects.sizes import JOINT, PER_LENGTH, SHIFT, STIFFEST, Size

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect, Law
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "elastic")
_SHORTEST_M = 0.05
_ONE_SECTION = "one section"
# Arms get thinner towards the wrist.
_TAPER = Shape("taper", "1", 0.3, 0.0, 0.6, tried=1)
# Published compliances are up to five times those that suit the size of an arm.
_OVER_USUAL = 10.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def joint_compliance(sites: Sites) -> Candidate:
    """Make one candidate of the compliances of all joints, each a torsional spring:
    theta_i = c_i tau_i (equation 7).

    It is not an effect of the catalogue: the declared model contains it if the
    compliances are to be identified.
    """
    units = ["m/N" if prismatic else "rad/(N m)" for prismatic in sites.prismatic]
    sizes = [_OVER_USUAL * compliance for compliance in sites.compliance]
    parameters = tuple(
        Parameter(f"c{j}", unit, size)
        for j, (unit, size) in enumerate(zip(units, sizes, strict=True), 1)
    )
    law = _springs([joint] for joint in range(sites.joints))
    return Candidate(
        "joint_compliance", "declared", (), "", parameters, law, frozenset({"load"})
    )


def _springs(groups: Iterable[Iterable[int]]) -> Law:
    """Make the law of coordinates that each yield to their own load; one parameter
    belongs to each group of coordinates."""
    members = [tuple(group) for group in groups]

    def loads(around: Conditions, group: tuple[int, ...]) -> dict[int, np.ndarray]:
        return {coordinate: around.total[:, coordinate] for coordinate in group}

    return lambda around: [loads(around, group) for group in members]


def _bending(sites: Sites) -> list[tuple[tuple[int, ...], str]]:
    """Each link with a length, named by the joint before it; the column; and all links
    with one section.

    One section is what a robot of like tubes has: two parameters for the whole arm,
    where a candidate a link has two each.
    """
    long = tuple(
        k
        for k in range(sites.joints + 1)
        if np.linalg.norm(sites.link_vectors_m[k]) > _SHORTEST_M
    )
    together = [(long, _ONE_SECTION)] if len(long) > 1 else []
    return [*(((link,), "" if link else "column") for link in long), *together]


@_effect(
    "elastic bending and torsion",
    Size(
        "1/EI",
        1.0,
        "a link bends as much as the gear before it turns",
        PER_LENGTH,
        sign=1,
    ),
    at=_bending,
    part="link",
    detail_words={_ONE_SECTION: "all of one cross-section"},
    formula=(
        r"y = \frac{F_y l^3 a}{E I} + \frac{M_z l^2 b}{E I}, \quad r_z = "
        r"\frac{F_y l^2 b}{E I} + \frac{M_z l c}{E I}, \quad r_x = \frac{M_x l "
        r"c}{G J}"
    ),
)
def link_elasticity(
    entry: Effect, sites: Sites, links: tuple[int, ...], detail: str
) -> Candidates:
    """A link that bends and twists: a cantilever between two joints.

    y = F_y l^3 a/EI + M_z l^2 b/EI, r_z = F_y l^2 b/EI + M_z l c/EI, likewise in the
    other plane, r_x = M_x l c/GJ.

    y, r_z and r_x are shift (m) and rotations (rad) of the far end under force F (N)
    and moment M (N m) there, with x along the link of length l (m): Euler-Bernoulli and St Venant
    (Timoshenko and Gere 1972). For a uniform link a, b, c = 1/3, 1/2, 1. For a thin-
    walled link whose diameter falls linearly by a share t to its far end, they are the
    integrals over s from 0 to 1 of (1 - s)^2, 1 - s and 1 over (1 - t s)^3. The law is
    linear in 1/EI and 1/GJ, 1/(N m^2), of the uniform link that a force shifts, and a
    moment along it twists, as far. Stretching and shear, which are small in links much
    longer than wide, are left out.
    """
    # A fit asks for the same taper under one load after the other.
    compliances = lru_cache(maxsize=4)(
        lambda taper: [_end_compliance(sites, link, taper) for link in links]
    )

    def law(around: Conditions, taper: float) -> Displacements:
        bent: dict[int, np.ndarray] = {}
        twisted: dict[int, np.ndarray] = {}
        load = around.total.T
        for link, (bending, torsion) in zip(
            links, compliances(float(taper)), strict=True
        ):
            coordinates = sites.link_end[link]
            wrench = load[coordinates[0] : coordinates[-1] + 1]
            bent |= zip(coordinates, bending @ wrench, strict=True)
            twisted |= zip(coordinates[3:], torsion @ wrench[3:], strict=True)
        return [bent, twisted]

    longest = max(links, key=lambda k: float(np.linalg.norm(sites.link_vectors_m[k])))
    length = float(np.linalg.norm(sites.link_vectors_m[longest]))
    before = max(longest - 1, 0)
    names = ("bending_1_over_EI", "torsion_1_over_GJ")
    parameters = entry.parameters(
        "1/EI", names, "1/(N m^2)", sites, before, over=length
    )
    joints = tuple(k for k in links if k)
    needs = load_behind(sites, max(links))
    yield entry.candidate(
        joints,
        parameters,
        law,
        needs,
        shapes=(_TAPER,),
        detail=detail,
        location_name=detail,
    )


def _end_compliance(
    sites: Sites, link: int, taper: float
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the far end of a link by its wrench for a unit of 1/EI, (6, 6),
    and its turn by the moment for 1/GJ."""
    places = 0.5 * (1.0 + _NODES)
    softer = _WEIGHTS / (1.0 - taper * places) ** 3
    a, b, c = (float(softer @ (1.0 - places) ** power) for power in (2, 1, 0))
    by_either = b / (3.0 * a)
    turn_by_moment = c / (3.0 * a)
    length = np.linalg.norm(sites.link_vectors_m[link])
    along = sites.link_vectors_m[link] / length
    lengthwise = np.outer(along, along)
    across = np.eye(3) - lengthwise
    turned = np.cross(np.eye(3), along).T * by_either * length**2
    bending = np.block(
        [
            [length**3 / 3.0 * across, turned @ across],
            [-turned @ across, turn_by_moment * length * across],
        ]
    )
    return bending, length * lengthwise


@_effect(
    "bearing tilt",
    Size(
        "tilt",
        1.0,
        "bearings tilt as much as gears turn (Klimchik et al. 2015)",
        JOINT,
        sign=1,
    ),
    at=every_joint,
    formula=r"\theta_e = c_e\, (e \cdot M_i)",
)
def joint_tilt(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """A bearing that tilts across its axis under the moment that it carries.

    theta_e = c_e (e . M_i) at joint i, with theta_e the tilt (rad) about each of the
    two axes e across the joint's own, which turn with it, M_i the moment of load and
    declared masses there (N m) and c_e in rad/(N m) (Reinl et al. 2011). The carriage
    of a prismatic joint rolls about its own axis as well.
    """
    # A carriage rolls about its own axis too, which is no joint's.
    across = [
        axis
        for axis in range(3)
        if sites.prismatic[joint] or axis != sites.joint_axes[joint]
    ]
    tilts = entry.parameters(
        "tilt",
        [f"tilt_about_{'xyz'[axis]}" for axis in across],
        "rad/(N m)",
        sites,
        joint,
    )
    law = _springs([sites.tilt[joint][axis]] for axis in across)
    yield entry.candidate((joint + 1,), tilts, law, load_behind(sites, joint))


@_effect(
    "elasticity of the foundation",
    Size("tilt", 0.3, "a foundation is stiffer than what it bears", STIFFEST, sign=1),
    Size("shift", 0.01, "the same at a fifth of the reach", SHIFT, sign=1),
    formula=(
        r"u = C \begin{pmatrix} F \\ M + p \times F \end{pmatrix}, \quad C = "
        r"\mathrm{diag}(c_h, c_h, c_v, c_t, c_t, 0)"
    ),
)
def base_compliance(entry: Effect, sites: Sites) -> Candidates:
    """A foundation that yields elastically: floor, anchors or pedestal let the foot of
    the robot shift and tilt under the load.

    u = C (F, M + p x F), C = diag(c_h, c_h, c_v, c_t, c_t, 0), is the displacement of
    the foot (m, rad) in base axes under a force F (N) and a moment M (N m) at p (m),
    declared masses included; c_h and c_v in m/N, c_t in rad/(N m), like a rigid footing
    on springs (Richart, Hall and Woods 1970). The compliance about the vertical is that
    of a joint 1 that turns about it, and is not counted again.
    """
    tx, ty, tz, rx, ry, _ = sites.base
    shifts = entry.parameters("shift", ["horizontal", "vertical"], "m/N", sites)
    tilt = entry.parameters("tilt", ["tilt"], "rad/(N m)", sites)
    every = entry.candidate(
        (), (*shifts, *tilt), _springs([(tx, ty), (tz,), (rx, ry)]), {"load"}
    )
    # Rocking alone is what most foundations do.
    yield from (every, small_form(every, "rocking", slice(2, None)))


@_effect(
    "elastic coupling",
    Size(
        "coupling",
        0.3,
        "of the geometric mean, beyond which a joint would give energy back",
        JOINT,
    ),
    at=lambda sites: combinations([joint for (joint,) in turning_joints(sites)], 2),
    formula=r"\theta_i = c_{ij} \tau_j, \quad \theta_j = c_{ij} \tau_i",
)
def cross_compliance(entry: Effect, sites: Sites, one: int, other: int) -> Candidates:
    """Elastic coupling of two joints: each turns under the torque of the other, as
    where one flexible casting holds both gears.

    theta_i = c_ij tau_j and theta_j = c_ij tau_i, with theta in rad, tau the torques of
    load and declared masses (N m) and c_ij in rad/(N m), the same both ways by the
    reciprocal theorem of elastic bodies (Timoshenko and Goodier 1970). Of two parallel
    joints, seen at the end-effector alone, it is not distinguishable from bending of
    the link between them.
    """
    both = (one + 1, other + 1)
    coupling = entry.parameters(
        "coupling", ["compliance"], "rad/(N m)", sites, one, other
    )
    yield entry.candidate(
        both,
        coupling,
        lambda around: [{one: around.total[:, other], other: around.total[:, one]}],
        LOADED_JOINTS,
    )


@_effect(
    "angle-dependent stiffness",
    Size("variation", 0.3, "teeth and rollers in mesh vary by a third", JOINT),
    at=turning_joints,
    formula=r"\theta_i = \tau_i (u \cos q_i + v \sin q_i)",
)
def joint_dependent_stiffness(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """A joint compliance that changes with the angle of the joint: teeth, rollers and
    housing are not equally stiff all round.

    theta_i = tau_i (u cos q_i + v sin q_i), with theta_i and the joint angle q_i in
    rad, tau_i the torque of load and declared masses (N m), u and v in rad/(N m).
    Derived here: c_i(q_i) is periodic, and u and v are order 1 of its Fourier series,
    beside the mean, which is the compliance of the model.
    """

    variation = entry.parameters(
        "variation", ["cos_q", "sin_q"], "rad/(N m)", sites, joint
    )
    yield entry.of_joint(
        joint, variation, lambda around: _softer(around, joint, 1), LOADED_JOINTS
    )


def _softer(around: Conditions, joint: int, *orders: int) -> list[np.ndarray]:
    """Torque on a joint times waves of its angle."""
    return [
        around.total[:, joint] * wave
        for wave in waves(around.joint_angles[:, joint], *orders)
    ]


@_effect(
    "stiffness of the gravity compensator",
    Size("variation", 0.3, "a compensator is an order softer than its gear", JOINT),
    at=compensated_joint,
    formula=(
        r"k = -\frac{dT}{dq} = K a L \left[ \frac{s_0}{s} \left( \cos p + \frac{a "
        r"L \sin^2 p}{s^2} \right) - \cos p \right], \quad p = \alpha + q"
    ),
)
def compensator_stiffness(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Stiffness that a gravity compensator adds to the shoulder: its spring resists a
    turn more in some poses than in others.

    k = -dT/dq = K a L [(s0/s) (cos p + a L sin^2 p / s^2) - cos p], p = alpha + q,

    is what the spring (Klimchik et al. 2013) adds (N m/rad), with T and its symbols as
    in `compensator_torque`, and -c^2 k is what that adds to the compliance c of the
    joint. For a short crank it is theta = tau (u_1 cos q + v_1 sin q + u_2 cos 2q + v_2
    sin 2q), with theta in rad, tau the torque of load and declared masses (N m), u and
    v in rad/(N m).
    """

    variation = wave_parameters(entry, "variation", "rad/(N m)", sites, joint)
    yield entry.of_joint(
        joint, variation, lambda around: _softer(around, joint, 1, 2), LOADED_JOINTS
    )


@_effect(
    "flexibility of the flange",
    Size(
        "turn",
        0.1,
        "a bolted joint is ten times as stiff as a wrist's gear",
        JOINT,
        sign=1,
    ),
    Size("shift", 1e-2, "the same at a tenth of the reach", SHIFT, sign=1),
    formula=r"u = C w, \quad C \text{ diagonal}",
)
def flange_flexibility(entry: Effect, sites: Sites) -> Candidates:
    """A flange, its bearing or a tool changer that yields elastically: what holds the
    tool is a spring behind the last joint.

    u = C w, with u the shift (m) and turn (rad) of the flange along its axes, w the
    external force (N) and moment (N m) there and C diagonal, m/N and rad/(N m)
    (Klimchik et al. 2014). The turn about the axis of the last joint is held by the fit
    where its compliance is identified.
    """
    shifts = entry.parameters(
        "shift", [f"shift_{axis}" for axis in "xyz"], "m/N", sites
    )
    turns = entry.parameters(
        "turn", [f"turn_{axis}" for axis in "xyz"], "rad/(N m)", sites, sites.joints - 1
    )
    every = entry.candidate(
        (), (*shifts, *turns), _springs([c] for c in sites.link_end[-1]), LOADED_JOINTS
    )
    # Turns alone are most of what a flange does.
    yield from (every, small_form(every, "turns", slice(3, None)))
