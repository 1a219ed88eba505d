"""Campaigns of robots of ordinary geometry of which one thing is declared wrongly: a target, the base, a link's length."""

import numpy as np
from made_folders import made_document
from scipy.spatial.transform import Rotation

from elastocal.campaigns.writing import write_campaign
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.sites import sites_of

DECLARED_M = np.array([0.1, 0.0, 0.05])


def misdeclared_folder(folder, robot, name, place, shift_m, poses_measured=40, seed=1):
    """Unloaded poses of one target on the end effector, 60 µm and 60 µrad of noise; `place`: "tool", "base", "link 3" or ""."""
    draws, sites, end = np.random.default_rng(seed), sites_of(robot), robot.chain.end_effector
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((poses_measured, robot.joints))
    coordinates = np.zeros((poses_measured, sites.chain.coordinates))
    coordinates[:, : robot.joints] = angles + 5e-4 * draws.standard_normal(robot.joints)
    for link in range(1, robot.joints + 1):
        coordinates[:, sites.link_end[link]] += 3e-4 * draws.standard_normal(6)
    if place == "base":
        coordinates[:, sites.base[:3]] += shift_m
    elif place.startswith("link"):
        coordinates[:, sites.link_end[int(place[5:])][:3]] += shift_m
    at, turned = poses(sites.chain, coordinates, sites.chain.end_effector)
    at = at + turned @ (DECLARED_M + (np.array(shift_m) if place == "tool" else 0.0))
    turn = Rotation.from_rotvec(6e-5 * draws.standard_normal(at.shape)) * Rotation.from_matrix(turned)
    none = np.zeros(poses_measured, int)
    table = {"pose": np.arange(1, poses_measured + 1), "load": none, "repeat": none, "target": np.repeat("A", poses_measured)}
    table |= {f"q{joint}": column for joint, column in enumerate(robot.reported_angles(angles).T, 1)}
    table |= dict(zip("xyz", (at + 6e-5 * draws.standard_normal(at.shape)).T, strict=True))
    table |= dict(zip(("rx", "ry", "rz"), turn.as_rotvec().T, strict=True))
    changes = {"robot": name, "measured": "pose", "targets": {"A": {"point": end.name, "offset_m": DECLARED_M.tolist()}}}
    changes |= {"declared": ["joint_offset", "link_geometry"], "compliance": "nominal"}
    changes |= {"noise": {"position_m": 6e-5, "orientation_rad": 6e-5}}
    folder.mkdir(parents=True)
    write_campaign(folder, made_document("made") | changes, table, robot.joints, "csv")
    return folder
