"""Frames slide along their own axes and change nothing at the end."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from elastocal.exchange.slid_frames import lengths_of, slid_words
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import poses


def homogeneous(rotation, shift):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation, shift
    return made


def moved(kind, amount):
    if kind == "P":
        return homogeneous(np.eye(3), [0, 0, amount])
    return homogeneous(Rotation.from_euler("z", amount).as_matrix(), [0, 0, 0])


@given(seed=st.integers(0, 10**6), kinds=st.text("RP", min_size=1, max_size=5))
def test_poses_of_all_points_are_those_of_the_pieces(seed, kinds):
    rng = np.random.default_rng(seed)

    def piece(name):
        return homogeneous(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-3, 3, 3)), name

    gaps = [[piece(""), piece("base"), piece("")], *([piece(f"p{number}"), piece("")] for number in range(len(kinds)))]
    gaps[-1].append(piece("end"))
    words, slides = slid_words(gaps, kinds)
    assert slides.shape == (len(kinds) + 1,) and slides[0] == 0.0
    chain = parse_chain(" ".join(words), {}, "test")
    points = {point.name: point for point in chain.points}
    q = rng.uniform(-2, 2, len(kinds))
    at = np.eye(4)
    for number, gap in enumerate(gaps):
        if number:
            at = at @ moved(kinds[number - 1], q[number - 1])
        for transform, name in gap:
            at = at @ transform
            if name:
                position, rotation = poses(chain, q[None], points[name])
                np.testing.assert_allclose(position[0], at[:3, 3], rtol=0, atol=1e-9)
                np.testing.assert_allclose(rotation[0], at[:3, :3], rtol=0, atol=1e-9)


def test_parallel_axes_come_to_one_another():
    gaps = [
        [(np.eye(4), "")],
        [(homogeneous(np.eye(3), [0.4, 0, 300.0]), "")],
        [(homogeneous(np.eye(3), [0, 0, -299.9]), "end")],
    ]
    words, slides = slid_words(gaps, "RR")
    assert words == ["Rz(q1)", "Tx(0.4)", "Rz(q2)", "Tz(0.1)", "[end]"] and slides.tolist() == [0.0, 0.0, -300.0]
    assert lengths_of(words) == 0.5
