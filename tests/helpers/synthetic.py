"""Campaigns made up for tests: states, models, estimates and what a tracker would read
of them."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from support import robot_on

from elastocal.campaigns.campaign import Measurements, Target
from elastocal.effects.catalogue import candidates_on
from elastocal.effects.conditions import build_conditions
from elastocal.effects.elastic import joint_compliance
from elastocal.effects.gravity import declared_weight
from elastocal.fitting.model import (
    Estimate,
    Model,
    apply_step,
    compute_residuals,
    evaluate_conditions,
    list_parameters,
    predict,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.observations import Observations, States
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.robot import Compensator, Robot
from elastocal.mechanics.sites import build_sites

NOISE = Noise("declared", 60e-6, 60e-6, np.zeros(6))


def make_states(joints, count, seed=0, force=500.0, span=1.2, sessions=1, repeats=1):
    """States anywhere, each under a load of its own, with everything that an effect may
    ask for."""
    rng = np.random.default_rng(seed)
    wrench = np.concatenate(
        [rng.standard_normal((count, 3)), 0.3 * rng.standard_normal((count, 3))], axis=1
    )
    return States(
        session=np.sort(np.arange(count) % sessions),
        pose=np.arange(count),
        load=np.ones(count, int),
        joint_angles=rng.uniform(-span, span, (count, joints)),
        wrench=force * wrench,
        repeats=np.full(count, repeats),
        approach=rng.choice([-1.0, 1.0], (count, joints)),
        time_s=np.sort(rng.uniform(0, 4 * 3600, count)),
        temperature_c=20 + np.sort(rng.uniform(0, 10, count)),
        row=1 + np.arange(count),
    )


def equipped(holder):
    """Sites of a robot or a chain with a compensator beside its shoulder and a known
    gear: no effect is out of place there."""
    robot = (
        holder
        if isinstance(holder, Robot)
        else robot_on(holder, np.zeros(holder.coordinates))
    )
    sites = build_sites(robot)
    if sites.compensator is None and sites.shoulder is not None:
        sites = replace(sites, compensator=Compensator(sites.shoulder + 1, "spring"))
    return (
        sites
        if sites.gear_ratio
        else replace(sites, gear_ratio=(101.0, *[None] * (sites.joints - 1)))
    )


def make_model(
    holder,
    targets=None,
    rows=3,
    fitted_frames=True,
    compliance=None,
    effects=(),
    identified=False,
):
    """A model of a chain or a robot; its targets are unknown offsets from the last
    measuring point by default."""
    sites = equipped(holder)
    targets = (
        (Target("A", sites.chain.end_effector.name, None),)
        if targets is None
        else targets
    )
    compliance = (
        1e-6 * np.arange(1, sites.joints + 1)
        if compliance is None
        else np.asarray(compliance)
    )
    springs = (joint_compliance(sites),) if identified else ()
    weight = (declared_weight(sites),) if sites.masses else ()
    return Model(
        sites,
        tuple(targets),
        fitted_frames,
        rows,
        compliance,
        (*springs, *weight, *effects),
    )


def make_estimate(model, sessions=(0,), seed=0, size=0.3):
    """Frames and targets anywhere; every parameter of an effect at up to `size` times
    its plausible size."""
    rng = np.random.default_rng(seed)
    count = len(sessions)
    fitted = model.fitted_frames
    frames = (
        Rotation.random(count, rng=rng).as_matrix()
        if fitted
        else np.tile(np.eye(3), (count, 1, 1))
    )
    offsets = []
    turns = []
    for target in model.targets:
        unknown = target.offset_m is None
        offsets.append(rng.uniform(-0.1, 0.1, 3) if unknown else target.offset_m)
        known = target.rotation is not None or model.rows == 3
        turns.append(
            (
                Rotation.from_rotvec(target.rotation or np.zeros(3))
                if known
                else Rotation.random(rng=rng)
            ).as_matrix()
        )
    sizes = [
        np.array([parameter.plausible for parameter in effect.parameters])
        for effect in model.effects
    ]
    return Estimate(
        tuple(sessions),
        frames,
        rng.uniform(-2, 2, (count, 3)) * fitted,
        np.array(offsets),
        np.array(turns),
        tuple(
            size * plausible * rng.uniform(-1, 1, len(plausible)) for plausible in sizes
        ),
        tuple(
            np.array([shape.start for shape in effect.shapes])
            for effect in model.effects
        ),
    )


def observe_exactly(model, estimate, states):
    """Every target in every state, read without noise in the frame of its session."""
    state = np.repeat(np.arange(len(states)), len(model.targets))
    target = np.tile(np.arange(len(model.targets)), len(states))
    blank = Observations(states, state, target, np.zeros((len(state), 3)), None)
    position, rotation = predict(
        model, estimate, blank, evaluate_conditions(model, estimate, states)
    )
    session = np.searchsorted(estimate.sessions, states.session[state])
    turn = estimate.frame_rotation[session]
    shift = estimate.frame_position[session]
    position = (turn @ position[..., None])[..., 0] + shift
    return Observations(
        states, state, target, position, turn @ rotation if model.rows == 6 else None
    )


def add_noise(observations, rng, position_m=60e-6, orientation_rad=60e-6):
    """The same observations, each component of each wrong by itself."""
    position = observations.position + position_m * rng.standard_normal(
        observations.position.shape
    )
    rotation = observations.rotation
    if rotation is not None:
        turn = Rotation.from_rotvec(
            orientation_rad * rng.standard_normal((len(position), 3))
        )
        rotation = turn.as_matrix() @ rotation
    return replace(observations, position=position, rotation=rotation)


def fill_measurements(pose, joint_angles, position, **others):
    """Measurements without loads and repeats, of one target, and with nothing that is
    optional, but for what is given."""
    none = np.zeros(len(pose), np.int32)
    count = len(pose)
    usual = {
        "session": none,
        "load": none,
        "repeat": none,
        "target": none,
        "wrench": np.zeros((count, 6)),
    }
    usual |= dict.fromkeys(("rotation_vector", "approach", "time_s", "temperature_c"))
    given = usual | {"row": np.arange(1, count + 1, dtype=np.int32)} | others
    return Measurements(
        pose=pose, joint_angles=joint_angles, position=position, **given
    )


def make_measurements(
    model, rng, poses_count, repeats, sensor_m, joint_rad, sensor_rad=0.0
):
    """Repeats of poses in base axes: the joints come to rest anew at each approach, the
    sensor errs at each measurement."""
    joints = model.sites.joints
    targets = len(model.targets)
    pose = np.repeat(np.arange(poses_count), repeats * targets)
    repeat = np.tile(np.repeat(np.arange(repeats), targets), poses_count)
    target = np.tile(np.arange(targets), poses_count * repeats)
    commanded = rng.uniform(-1.2, 1.2, (poses_count, joints))[pose]
    rest = (joint_rad * rng.standard_normal((poses_count * repeats, joints))).repeat(
        targets, axis=0
    )
    coordinates = np.zeros((len(pose), model.sites.chain.coordinates))
    coordinates[:, :joints] = commanded + rest
    position = np.empty((len(pose), 3))
    rotation = np.empty((len(pose), 3, 3))
    for index, one in enumerate(model.targets):
        point = replace(model.sites.chain.point(one.point), offset_m=one.offset_m)
        mask = target == index
        position[mask], rotation[mask] = compute_poses(
            model.sites.chain, coordinates[mask], point
        )
    turned = Rotation.from_rotvec(
        sensor_rad * rng.standard_normal((len(pose), 3))
    ) * Rotation.from_matrix(rotation)
    return fill_measurements(
        pose=pose,
        repeat=repeat,
        target=target,
        joint_angles=commanded,
        position=position + sensor_m * rng.standard_normal(position.shape),
        rotation_vector=turned.as_rotvec() if model.rows == 6 else None,
    )


def conditions_on(holder, states, compliance=None):
    """Conditions of some states on a chain or a robot."""
    sites = equipped(holder)
    compliance = (
        1e-6 * np.arange(1, sites.joints + 1) if compliance is None else compliance
    )
    return build_conditions(sites, compliance, states)


def find_candidate(holder, key):
    """One candidate of the catalogue, on a chain or a robot."""
    return candidates_on(equipped(holder))[key]


def displacements(candidate, conditions, *shapes):
    """What each parameter of a candidate makes, on every coordinate of the sites:
    ndarray (D, S, C)."""
    laws = candidate.displacement(conditions, *shapes)
    assert len(laws) == len(candidate.parameters)
    dense = np.zeros((len(laws), *conditions.load.shape))
    for number, law in enumerate(laws):
        for coordinate, values in law.items():
            dense[number, :, coordinate] = values
    return dense


def small_steps(model, estimate):
    """A step of each parameter for which a central difference loses nothing to
    curvature or rounding."""
    shapes = {
        (effect.key, shape.name) for effect in model.effects for shape in effect.shapes
    }
    listed = list_parameters(model, estimate)
    return np.array(
        [
            (1e-4 if (owner, p.name) in shapes else 1e-3) * p.plausible
            for owner, p in listed
        ]
    )


def slopes(model, estimate, observations, conditions, steps):
    """Changes of the prediction per step, by central differences of the residuals:
    ndarray (M, rows, number of steps)."""
    columns = []
    for step in steps:
        ahead, behind = (
            compute_residuals(
                model,
                apply_step(model, estimate, sign * step),
                observations,
                conditions,
            )
            for sign in (1, -1)
        )
        columns.append((behind - ahead) / 2)
    return np.stack(columns, axis=-1)
