"""Elastic effects, which are proportional to the load."""

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
# Shorter links are offsets between axes, whose bending is negligible.
_SHORTEST_M = 0.05
_ONE_SECTION = "one section"
# Share by which the diameter of a link falls along it: arms get thinner towards the wrist.
_TAPER = Shape("taper", "1", 0.3, 0.0, 0.6, tried=1)
# Upper bound on compliances, as a multiple of those that suit the size of an arm. Published
# compliances reach five times these.
_OVER_USUAL = 10.0
# Scale of the half-normal prior of a compliance, in upper bounds: one compliance in twenty
# exceeds its bound.
_PRIOR_OF_BOUND = 1.0 / 1.96
# Gauss-Legendre quadrature along a link.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def joint_compliance(sites: Sites) -> Candidate:
    """Make one candidate of the compliances of all joints, each a torsional spring:
    theta_i = c_i tau_i (equation 7).

    Springs yield to their load, so no compliance is negative: each has a half-normal
    prior, wide against what robots have. Measurements that hardly show a joint's
    compliance leave it rigid rather than at a guess or at a value of either sign.

    It is not an effect of the catalogue. The declared model contains it if the compliances
    are to be identified.
    """
    units = ["m/N" if prismatic else "rad/(N m)" for prismatic in sites.prismatic]
    sizes = [_OVER_USUAL * compliance for compliance in sites.compliance]
    parameters = tuple(
        Parameter(f"c{j}", unit, size, _PRIOR_OF_BOUND * size, sign=1)
        for j, (unit, size) in enumerate(zip(units, sizes, strict=True), 1)
    )
    law = _make_spring_law([joint] for joint in range(sites.joints))
    return Candidate(
        "joint_compliance", "declared", (), "", parameters, law, frozenset({"load"})
    )


def _make_spring_law(groups: Iterable[Iterable[int]]) -> Law:
    """Make the law of coordinates that yield to their own loads, with one compliance for
    each group of coordinates."""
    members = [tuple(group) for group in groups]

    def law(conditions: Conditions) -> Displacements:
        load = conditions.total.T
        displacements = []
        for group in members:
            displacements.append({coordinate: load[coordinate] for coordinate in group})
        return displacements

    return law


def _bending_places(sites: Sites) -> list[tuple[tuple[int, ...], str]]:
    """List each long link, by the number of the joint before it and 0 for the column, and
    all of them together.

    Together they have two parameters for the whole arm: a robot of similar tubes has one
    cross-section.
    """
    lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
    long_links = tuple(np.flatnonzero(lengths > _SHORTEST_M).tolist())
    places: list[tuple[tuple[int, ...], str]] = [
        ((link,), "" if link else "column") for link in long_links
    ]
    if len(long_links) > 1:
        places.append((long_links, _ONE_SECTION))
    return places


@_effect(
    "elastic bending and torsion",
    Size(
        "1/EI",
        1.0,
        "a link bends as much as the gear before it yields",
        PER_LENGTH,
        sign=1,
    ),
    at=_bending_places,
    part="link",
    detail_words={_ONE_SECTION: "one cross-section"},
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
    and moment M (N m) there, with x along the link of length l (m): Euler-Bernoulli and
    St Venant (Timoshenko and Gere 1972). For a uniform link a, b, c = 1/3, 1/2, 1. For a
    thin-walled link whose diameter falls linearly by a share t to its far end, they are
    the integrals over s from 0 to 1 of (1 - s)^2, 1 - s and 1 over (1 - t s)^3. The law is
    linear in 1/EI and 1/GJ, 1/(N m^2), of the uniform link that has the same deflection
    under a force and the same torsion. Stretching and shear, which are small in slender
    links, are neglected.
    """
    # A fit evaluates the law under one load after the other, with the same taper.
    compliances = lru_cache(maxsize=4)(
        lambda taper: [_end_compliance(sites, link, taper) for link in links]
    )

    def law(conditions: Conditions, taper: float) -> Displacements:
        bent: dict[int, np.ndarray] = {}
        twisted: dict[int, np.ndarray] = {}
        load = conditions.total.T
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
    """Compute the compliances of the far end of a link: for bending (6, 6), per unit of
    1/EI, and for torsion (3, 3), per unit of 1/GJ."""
    positions = 0.5 * (1.0 + _NODES)
    flexibility = _WEIGHTS / (1.0 - taper * positions) ** 3
    a, b, c = (float(flexibility @ (1.0 - positions) ** power) for power in (2, 1, 0))
    coupling = b / (3.0 * a)
    rotation_by_moment = c / (3.0 * a)
    length = np.linalg.norm(sites.link_vectors_m[link])
    direction = sites.link_vectors_m[link] / length
    along = np.outer(direction, direction)
    across = np.eye(3) - along
    shift_by_moment = np.cross(np.eye(3), direction).T * coupling * length**2
    bending = np.block(
        [
            [length**3 / 3.0 * across, shift_by_moment @ across],
            [-shift_by_moment @ across, rotation_by_moment * length * across],
        ]
    )
    return bending, length * along


@_effect(
    "bearing tilt",
    Size(
        "tilt",
        1.0,
        "bearings tilt as much as gears yield (Klimchik et al. 2015)",
        JOINT,
        sign=1,
    ),
    at=every_joint,
    formula=r"\theta_e = c_e\, (e \cdot M_i)",
)
def joint_tilt(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """A bearing that tilts across its axis under its load.

    theta_e = c_e (e . M_i) at joint i, with theta_e the tilt (rad) about each of the
    two axes e across the joint axis, which turn with the joint, M_i the moment of load
    and declared masses there (N m) and c_e in rad/(N m) (Reinl et al. 2011). The carriage
    of a prismatic joint also rolls about its own axis.
    """
    # A carriage also rolls about its own axis, about which no joint turns.
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
    law = _make_spring_law([sites.tilt[joint][axis]] for axis in across)
    yield entry.candidate((joint + 1,), tilts, law, load_behind(sites, joint))


@_effect(
    "elasticity of the foundation",
    Size("tilt", 0.3, "a foundation is stiffer than the robot", STIFFEST, sign=1),
    Size("shift", 0.01, "the same at a fifth of the reach", SHIFT, sign=1),
    formula=(
        r"u = C \begin{pmatrix} F \\ M + p \times F \end{pmatrix}, \quad C = "
        r"\mathrm{diag}(c_h, c_h, c_v, c_t, c_t, 0)"
    ),
)
def base_compliance(entry: Effect, sites: Sites) -> Candidates:
    """A foundation that yields elastically: floor, anchors or pedestal let the robot base
    shift and tilt under the load.

    u = C (F, M + p x F), C = diag(c_h, c_h, c_v, c_t, c_t, 0), is the displacement of
    the foot (m, rad) in base axes under a force F (N) and a moment M (N m) at p (m),
    declared masses included; c_h and c_v in m/N, c_t in rad/(N m), like a rigid footing
    on springs (Richart, Hall and Woods 1970). The compliance about the vertical cannot
    be distinguished from that of joint 1, and is omitted.
    """
    tx, ty, tz, rx, ry, _ = sites.base
    shifts = entry.parameters("shift", ["horizontal", "vertical"], "m/N", sites)
    tilt = entry.parameters("tilt", ["tilt"], "rad/(N m)", sites)
    law = _make_spring_law([(tx, ty), (tz,), (rx, ry)])
    whole = entry.candidate((), (*shifts, *tilt), law, {"load"})
    yield whole
    # Most foundations only rock.
    yield small_form(whole, "rocking", slice(2, None))


@_effect(
    "elastic coupling",
    Size(
        "coupling",
        0.3,
        "of the geometric mean; a coupling beyond the mean would release energy",
        JOINT,
    ),
    at=lambda sites: combinations([joint for (joint,) in turning_joints(sites)], 2),
    formula=r"\theta_i = c_{ij} \tau_j, \quad \theta_j = c_{ij} \tau_i",
)
def cross_compliance(
    entry: Effect, sites: Sites, first: int, second: int
) -> Candidates:
    """Elastic coupling of two joints: each yields to the torque of the other, for example
    because one flexible casting holds both gears.

    theta_i = c_ij tau_j and theta_j = c_ij tau_i, with theta in rad, tau the torques of
    load and declared masses (N m) and c_ij in rad/(N m), the same both ways by the
    reciprocal theorem of elastic bodies (Timoshenko and Goodier 1970). For two parallel
    joints it cannot be distinguished, at the end-effector, from bending of the link
    between them.
    """
    coupling = entry.parameters(
        "coupling", ["compliance"], "rad/(N m)", sites, first, second
    )

    def law(conditions: Conditions) -> Displacements:
        load = conditions.total.T
        return [{first: load[second], second: load[first]}]

    yield entry.candidate((first + 1, second + 1), coupling, law, LOADED_JOINTS)


@_effect(
    "angle-dependent stiffness",
    Size(
        "variation",
        0.3,
        "the number of teeth and rollers in mesh varies by a third",
        JOINT,
    ),
    at=turning_joints,
    formula=r"\theta_i = \tau_i (u \cos q_i + v \sin q_i)",
)
def joint_dependent_stiffness(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """A joint compliance that changes with the joint angle, because teeth, rollers and
    housing are not equally stiff all round.

    theta_i = tau_i (u cos q_i + v sin q_i), with theta_i and the joint angle q_i in
    rad, tau_i the torque of load and declared masses (N m), u and v in rad/(N m).
    Derived here: c_i(q_i) is periodic; its mean is the compliance of the model, and u and
    v are order 1 of its Fourier series.
    """
    variation = entry.parameters(
        "variation", ["cos_q", "sin_q"], "rad/(N m)", sites, joint
    )
    yield entry.of_joint(
        joint,
        variation,
        lambda conditions: _modulate_torque(conditions, joint, 1),
        LOADED_JOINTS,
    )


def _modulate_torque(
    conditions: Conditions, joint: int, *orders: int
) -> list[np.ndarray]:
    """Multiply the torque on a joint by waves of its angle."""
    return [
        conditions.total[:, joint] * wave
        for wave in waves(conditions.joint_angles[:, joint], *orders)
    ]


@_effect(
    "stiffness of the gravity compensator",
    Size("variation", 0.3, "a compensator is ten times softer than its gear", JOINT),
    at=compensated_joint,
    formula=(
        r"k = -\frac{dT}{dq} = K a L \left[ \frac{s_0}{s} \left( \cos p + \frac{a "
        r"L \sin^2 p}{s^2} \right) - \cos p \right], \quad p = \alpha + q"
    ),
)
def compensator_stiffness(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Stiffness that a gravity compensator adds to the shoulder: its spring resists
    rotation more in some poses than in others.

    k = -dT/dq = K a L [(s0/s) (cos p + a L sin^2 p / s^2) - cos p], p = alpha + q,

    is the stiffness of the spring (Klimchik et al. 2013) (N m/rad), with T and its symbols
    as in `compensator_torque`; it changes the compliance c of the joint by -c^2 k. For a
    short crank the deflection is theta = tau (u_1 cos q + v_1 sin q + u_2 cos 2q + v_2
    sin 2q), with theta in rad, tau the torque of load and declared masses (N m), u and
    v in rad/(N m).
    """
    variation = wave_parameters(entry, "variation", "rad/(N m)", sites, joint)
    yield entry.of_joint(
        joint,
        variation,
        lambda conditions: _modulate_torque(conditions, joint, 1, 2),
        LOADED_JOINTS,
    )


@_effect(
    "flexibility of the flange",
    Size(
        "turn",
        0.1,
        "a bolted joint is ten times as stiff as the gear of a wrist",
        JOINT,
        sign=1,
    ),
    Size("shift", 1e-2, "the same at a tenth of the reach", SHIFT, sign=1),
    formula=r"u = C w, \quad C \text{ diagonal}",
)
def flange_flexibility(entry: Effect, sites: Sites) -> Candidates:
    """A flange, its bearing or a tool changer that yields elastically: the tool is held by
    a spring behind the last joint.

    u = C w, with u the shift (m) and rotation (rad) of the flange along its axes, w the
    external force (N) and moment (N m) there and C diagonal, m/N and rad/(N m)
    (Klimchik et al. 2014). The fit keeps the rotation about the axis of the last joint at
    zero if the compliance of that joint is identified.
    """
    shifts = entry.parameters(
        "shift", [f"shift_{axis}" for axis in "xyz"], "m/N", sites
    )
    turns = entry.parameters(
        "turn", [f"turn_{axis}" for axis in "xyz"], "rad/(N m)", sites, sites.joints - 1
    )
    law = _make_spring_law([coordinate] for coordinate in sites.link_end[-1])
    whole = entry.candidate((), (*shifts, *turns), law, LOADED_JOINTS)
    yield whole
    # Most flanges only rotate.
    yield small_form(whole, "turns", slice(3, None))
