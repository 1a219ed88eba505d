"""Synthetic states, models and estimates, and the measurements that a tracker would
take of them."""

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
from elastocal.mechanics.sites import PushedSession, build_sites

NOISE = Noise("declared", 60e-6, 60e-6, np.zeros(6))


def make_states(joints, count, seed=0, force=500.0, span=1.2, sessions=1, repeats=1):
    """Draw states, each under its own load, with every quantity that an effect may
    depend on."""
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
    """Return the sites of a robot or a chain, with a compensator at its shoulder and a
    known gear ratio, so that every effect has candidates there, and with a stand that is
    pushed."""
    robot = holder
    if not isinstance(holder, Robot):
        robot = robot_on(holder, np.zeros(holder.coordinates))
    sites = build_sites(robot)
    if sites.compensator is None and sites.shoulder is not None:
        sites = replace(sites, compensator=Compensator(sites.shoulder + 1, "spring"))
    if not sites.gear_ratio:
        sites = replace(sites, gear_ratio=(101.0, *[None] * (sites.joints - 1)))
    return replace(sites, pushed_sessions=(PushedSession(0, 0.0, 1.0),))


def make_model(
    holder,
    targets=None,
    rows=3,
    *,
    fitted_frames=True,
    compliance=None,
    effects=(),
    identified=False,
):
    """Make a model of a chain or a robot.

    By default it has one target at an unknown offset from the last measuring point.
    `identified` adds the joint compliances to the effects.
    """
    sites = equipped(holder)
    if targets is None:
        targets = [Target("A", sites.chain.end_effector.name, None)]
    if compliance is None:
        compliance = 1e-6 * np.arange(1, sites.joints + 1)
    declared = []
    if identified:
        declared.append(joint_compliance(sites))
    if sites.masses:
        declared.append(declared_weight(sites))
    return Model(
        sites,
        tuple(targets),
        fitted_frames,
        rows,
        np.asarray(compliance),
        (*declared, *effects),
    )


def draw_target_rotation(model, target, rng):
    """Draw the rotation of a target that measures orientations and whose rotation is
    not known; otherwise return the known rotation, or none."""
    if model.rows == 6 and target.rotation is None:
        return Rotation.random(rng=rng).as_matrix()
    return Rotation.from_rotvec(target.rotation or np.zeros(3)).as_matrix()


def draw_coefficients(effect, rng, size):
    """Draw the coefficients of an effect, up to `size` times their plausible sizes and
    with the signs that physics gives."""
    plausible = np.array([parameter.plausible for parameter in effect.parameters])
    drawn = size * plausible * rng.uniform(-1, 1, len(plausible))
    signs = np.array([parameter.sign for parameter in effect.parameters])
    return np.where(signs != 0, signs * np.abs(drawn), drawn)


def make_estimate(model, sessions=(0,), seed=0, size=0.3):
    """Draw an estimate with frames and targets anywhere.

    Coefficients are at most `size` times their plausible sizes; shape parameters are at
    their starts.
    """
    rng = np.random.default_rng(seed)
    count = len(sessions)
    frame_rotation = np.tile(np.eye(3), (count, 1, 1))
    if model.fitted_frames:
        frame_rotation = Rotation.random(count, rng=rng).as_matrix()
    offsets = []
    rotations = []
    for target in model.targets:
        offset_m = target.offset_m
        offsets.append(rng.uniform(-0.1, 0.1, 3) if offset_m is None else offset_m)
        rotations.append(draw_target_rotation(model, target, rng))
    frame_position = rng.uniform(-2, 2, (count, 3)) * model.fitted_frames
    shapes = []
    for effect in model.effects:
        shapes.append(np.array([shape.start for shape in effect.shapes]))
    return Estimate(
        tuple(sessions),
        frame_rotation,
        frame_position,
        np.array(offsets),
        np.array(rotations),
        tuple(draw_coefficients(effect, rng, size) for effect in model.effects),
        tuple(shapes),
    )


def observe_exactly(model, estimate, states):
    """Observe every target in every state without noise, in the frame of its
    session."""
    state = np.repeat(np.arange(len(states)), len(model.targets))
    target = np.tile(np.arange(len(model.targets)), len(states))
    blank = Observations(states, state, target, np.zeros((len(state), 3)), None)
    position, rotation = predict(
        model, estimate, blank, evaluate_conditions(model, estimate, states)
    )
    session = np.searchsorted(estimate.sessions, states.session[state])
    frame_rotation = estimate.frame_rotation[session]
    frame_position = estimate.frame_position[session]
    position = (frame_rotation @ position[..., None])[..., 0] + frame_position
    rotation = frame_rotation @ rotation if model.rows == 6 else None
    return Observations(states, state, target, position, rotation)


def add_noise(observations, rng, position_m=60e-6, orientation_rad=60e-6):
    """Return the observations with independent noise in each component."""
    position = observations.position + position_m * rng.standard_normal(
        observations.position.shape
    )
    rotation = observations.rotation
    if rotation is not None:
        noise = Rotation.from_rotvec(
            orientation_rad * rng.standard_normal((len(position), 3))
        )
        rotation = noise.as_matrix() @ rotation
    return replace(observations, position=position, rotation=rotation)


def fill_measurements(pose, joint_angles, position, **columns):
    """Build measurements with some columns given.

    By default they have one target, no loads and no repeats, and no optional column.
    """
    count = len(pose)
    zero = np.zeros(count, np.int32)
    defaults = {
        "session": zero,
        "load": zero,
        "repeat": zero,
        "target": zero,
        "wrench": np.zeros((count, 6)),
        "row": np.arange(1, count + 1, dtype=np.int32),
        "rotation_vector": None,
        "approach": None,
        "time_s": None,
        "temperature_c": None,
    }
    return Measurements(
        pose=pose, joint_angles=joint_angles, position=position, **(defaults | columns)
    )


def make_measurements(
    model, rng, poses_count, repeats, sensor_m, joint_rad, sensor_rad=0.0
):
    """Simulate repeats of poses in base axes: the joints come to rest anew at each
    approach, and each measurement has its own sensor noise."""
    targets = len(model.targets)
    pose = np.repeat(np.arange(poses_count), repeats * targets)
    repeat = np.tile(np.repeat(np.arange(repeats), targets), poses_count)
    target = np.tile(np.arange(targets), poses_count * repeats)
    commanded = rng.uniform(-1.2, 1.2, (poses_count, model.sites.joints))[pose]
    rest_error = (
        joint_rad * rng.standard_normal((poses_count * repeats, model.sites.joints))
    ).repeat(targets, axis=0)
    coordinates = np.zeros((len(pose), model.sites.chain.coordinates))
    coordinates[:, : model.sites.joints] = commanded + rest_error
    position = np.empty((len(pose), 3))
    rotation = np.empty((len(pose), 3, 3))
    for index, mounted in enumerate(model.targets):
        point = replace(
            model.sites.chain.point(mounted.point), offset_m=mounted.offset_m
        )
        mask = target == index
        position[mask], rotation[mask] = compute_poses(
            model.sites.chain, coordinates[mask], point
        )
    noise = Rotation.from_rotvec(sensor_rad * rng.standard_normal((len(pose), 3)))
    rotation_vector = None
    if model.rows == 6:
        rotation_vector = (noise * Rotation.from_matrix(rotation)).as_rotvec()
    return fill_measurements(
        pose=pose,
        repeat=repeat,
        target=target,
        joint_angles=commanded,
        position=position + sensor_m * rng.standard_normal(position.shape),
        rotation_vector=rotation_vector,
    )


def conditions_on(holder, states, compliance=None):
    """Return the conditions of some states on a chain or a robot."""
    sites = equipped(holder)
    compliance = (
        1e-6 * np.arange(1, sites.joints + 1) if compliance is None else compliance
    )
    return build_conditions(sites, compliance, states)


def find_candidate(holder, key):
    """Return one candidate of the catalogue on a chain or a robot."""
    return candidates_on(equipped(holder))[key]


def displacements(candidate, conditions, *shapes):
    """Return the displacement by each parameter of a candidate of every coordinate of
    the sites: ndarray (D, S, C)."""
    laws = candidate.displacement(conditions, *shapes)
    assert len(laws) == len(candidate.parameters)
    dense = np.zeros((len(laws), *conditions.load.shape))
    for number, law in enumerate(laws):
        for coordinate, values in law.items():
            dense[number, :, coordinate] = values
    return dense


def small_steps(model, estimate):
    """Return a step of each parameter that is small enough for the curvature and large
    enough for the rounding of a central difference."""
    shapes = {
        (effect.key, shape.name) for effect in model.effects for shape in effect.shapes
    }
    steps = []
    for owner, parameter in list_parameters(model, estimate):
        is_shape = (owner, parameter.name) in shapes
        steps.append((1e-4 if is_shape else 1e-3) * parameter.plausible)
    return np.array(steps)


def slopes(model, estimate, observations, conditions, steps):
    """Return the change of the prediction by each step, by central differences of the
    residuals: ndarray (M, rows, number of steps)."""
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
