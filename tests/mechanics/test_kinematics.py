"""Equations 1-4 and Jacobians against pinocchio, scipy and the products that the paper
prints."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import (
    ODD_CHAINS,
    OTHER_CHAINS,
    PinocchioPoint,
    chain_of,
    homogeneous,
    random_angles,
)

from elastocal.mechanics import kinematics
from elastocal.mechanics.kinematics import (
    compute_jacobians,
    compute_motion,
    compute_poses,
    compute_poses_and_jacobians,
    compute_rotation_vectors,
)

# Tolerance, m and rad: a dozen products of values of order one have some tens of
# rounding errors of 1e-16.
ROUNDING = 2e-14


@st.composite
def chain_texts(draw):
    """Chains of one to eight joints with carriages, translations, fixed rotations and
    points anywhere."""
    tokens = []
    points = 0
    joints = draw(st.integers(1, 8))
    for joint in range(1, joints + 1):
        for kind in draw(st.lists(st.sampled_from("TRP"), max_size=4)):
            sign = draw(st.sampled_from(["", "-"]))
            axis = draw(st.sampled_from("xyz"))
            if kind == "P":
                points += 1
                tokens.append(f"[point{points}]")
            elif kind == "T":
                tokens.append(f"T{axis}({sign}{draw(st.integers(0, 2000)) / 1000:.3f})")
            else:
                tokens.append(f"R{axis}({sign}{draw(st.integers(0, 360))}deg)")
        kind, axis, sign = (
            draw(st.sampled_from(choices)) for choices in ("RRT", "xyz", ["", "-"])
        )
        tokens.append(f"{kind}{axis}({sign}q{joint})")
    return " ".join([*tokens, f"Tx({draw(st.integers(0, 500)) / 1000:.3f})", "[end]"])


@given(chain_texts(), st.integers(0, 2**32 - 1))
def test_random_chains_agree_with_pinocchio(text, seed):
    chain = chain_of(text)
    # Angles that are component first in memory are not copied; the package must not
    # change them.
    angles = np.asfortranarray(random_angles(np.random.default_rng(seed), chain, 3))
    before = angles.copy()
    for point in (chain.points[0], chain.end_effector):
        position, rotation, jacobian = compute_poses_and_jacobians(chain, angles, point)
        np.testing.assert_array_equal(compute_jacobians(chain, angles, point), jacobian)
        model = PinocchioPoint(chain, point)
        for index, configuration in enumerate(angles):
            expected = model.pose_and_jacobian(configuration)
            for found, value in zip(
                (position, rotation, jacobian), expected, strict=True
            ):
                np.testing.assert_allclose(found[index], value, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(angles, before)


def paper_poses(lengths, q):
    """Equations 1-4 with T_base and T_tool the identity, as they are printed."""
    l1, l2, l3, l4, l5, l6 = lengths
    x, y, z = range(3)
    t_2 = (
        homogeneous("T", z, l1)
        @ homogeneous("R", z, q[0])
        @ homogeneous("T", x, l2)
        @ homogeneous("R", y, q[1])
    ) @ homogeneous("T", x, l3)
    t_3 = (
        t_2
        @ homogeneous("R", y, q[2])
        @ homogeneous("T", z, l4)
        @ homogeneous("T", x, l5)
    )
    t_4 = t_3 @ homogeneous("R", x, q[3])
    t_full = (
        t_4
        @ homogeneous("R", y, q[4])
        @ homogeneous("R", x, q[5])
        @ homogeneous("T", x, l6)
    )
    return {"2DoF": t_2, "3DoF": t_3, "4DoF": t_4, "6DoF": t_full}


LENGTHS = {
    "kuka": (0.675, 0.350, 1.150, -0.041, 1.200, 0.240),
    "fanuc": (0.670, 0.312, 1.075, 0.225, 1.280, 0.215),
}


@pytest.mark.parametrize("key", LENGTHS)
def test_poses_are_the_matrix_products_of_equations_1_to_4(key, chain_called):
    chain = chain_called(key)
    angles = random_angles(np.random.default_rng(4), chain, 20)
    expected = [paper_poses(LENGTHS[key], q) for q in angles]
    for point in chain.points:
        position, rotation = compute_poses(chain, angles, point)
        np.testing.assert_allclose(
            position, [e[point.name][:3, 3] for e in expected], rtol=0, atol=ROUNDING
        )
        np.testing.assert_allclose(
            rotation, [e[point.name][:3, :3] for e in expected], rtol=0, atol=ROUNDING
        )


@pytest.mark.parametrize("size", [6, 7, 8, 14, 15])
def test_batches_across_a_block_are_those_of_its_parts(fanuc, monkeypatch, size):
    angles = random_angles(np.random.default_rng(7), fanuc.chain, size)
    whole = compute_poses_and_jacobians(fanuc.chain, angles, fanuc.chain.end_effector)
    monkeypatch.setattr(kinematics, "BLOCK", 7)
    for found, expected in zip(
        compute_poses_and_jacobians(fanuc.chain, angles, fanuc.chain.end_effector),
        whole,
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING)
    for found, expected in zip(
        compute_poses(fanuc.chain, angles, fanuc.chain.end_effector),
        whole[:2],
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(
        compute_jacobians(fanuc.chain, angles, fanuc.chain.end_effector),
        whole[2],
        rtol=0,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("name", ["kuka", *OTHER_CHAINS, *ODD_CHAINS])
def test_motion_gives_the_jacobian_of_every_point_and_the_forces_of_every_wrench(
    name, chain_called
):
    chain = chain_called(name)
    rng = np.random.default_rng(31)
    angles = random_angles(rng, chain, 7)
    wrench = rng.standard_normal((7, 6))
    points = [replace(point, offset_m=(0.1, -0.2, 0.3)) for point in chain.points]
    moved = compute_motion(chain, angles, points)
    for number, point in enumerate(points):
        position, rotation, jacobian = compute_poses_and_jacobians(chain, angles, point)
        np.testing.assert_allclose(
            moved.position[number].T, position, rtol=0, atol=ROUNDING
        )
        np.testing.assert_allclose(
            np.moveaxis(moved.rotation[number], -1, 0), rotation, rtol=0, atol=ROUNDING
        )
        full = moved.jacobian(point.after, moved.position[number])
        np.testing.assert_allclose(
            np.moveaxis(full, -1, 0), jacobian, rtol=0, atol=ROUNDING
        )
        subset = moved.jacobian(
            point.after, moved.position[number][:, [4, 1, 1]], 3, np.array([4, 1, 1])
        )
        np.testing.assert_allclose(
            np.moveaxis(subset, -1, 0), jacobian[[4, 1, 1], :3], rtol=0, atol=ROUNDING
        )
        moment = wrench[:, 3:] + np.cross(position, wrench[:, :3])
        acting = np.concatenate([wrench[:, :3], moment], axis=1).T
        forces = moved.generalized_forces(point.after, acting)
        np.testing.assert_allclose(
            forces.T,
            np.einsum("sij,si->sj", jacobian, wrench),
            rtol=0,
            atol=10 * ROUNDING,
        )


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.floats(0, np.pi - 1e-3))
def test_rotation_vectors_agree_with_scipy(direction, angle):
    norm = np.linalg.norm(direction)
    vector = angle * (
        np.array(direction) / norm if norm > 1e-3 else np.array([0.0, 0.0, 1.0])
    )
    rotation = Rotation.from_rotvec(vector)
    # sin(angle) near pi - 1e-3 keeps 13 of 16 digits.
    np.testing.assert_allclose(
        compute_rotation_vectors(rotation.as_matrix()),
        rotation.as_rotvec(),
        rtol=0,
        atol=1e-12,
    )


def test_a_cross_matrix_multiplies_as_the_cross_product_from_the_left():
    vectors, others = np.random.default_rng(1).normal(size=(2, 5, 3))
    products = kinematics.form_cross_matrices(vectors) @ others[..., None]
    np.testing.assert_allclose(products[..., 0], np.cross(vectors, others), atol=1e-15)


def test_aligning_points_finds_the_motion_also_of_points_in_a_plane():
    draws = np.random.default_rng(1)
    points = draws.standard_normal((6, 3)) * [1.0, 1.0, 0.0]
    translation = np.array([0.3, -0.2, 1.0])
    for rotation in Rotation.random(20, random_state=1):
        measured = translation + rotation.apply(points)
        aligned, shift = kinematics.align_points(points, measured)
        np.testing.assert_allclose(aligned, rotation.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(shift, translation, atol=1e-12)
