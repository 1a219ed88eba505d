"""The schemes of a robot are drawn from its chain: all names are there, and none hides another."""

from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from elastocal.figures.schemes import kinematic_scheme, spring_scheme
from elastocal.io.documents import read_document
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document

ROBOTS = Path(__file__).resolve().parents[2] / "config" / "robots"
CHAINS = {
    "three joints, turned frames": "Rz(q1) Ry(q2) Tx(1.0) Rx(90deg) Ry(q3) Rz(-30deg) Tx(0.5) [EE]",
    "one joint, no length": "Rz(q1) [EE]",
    "three axes that meet": "Tz(0.5) Rx(q1) Ry(q2) Rz(q3) Tx(0.4) Ry(-q4) Ty(0.1) Tx(0.3) [EE]",
    "pitch about x": "Tz(0.34) Rz(q1) Rx(q2) Tz(0.4) Rz(q3) Rx(-q4) Tz(0.4) Rz(q5) Rx(q6) Rz(q7) Tz(0.126) [flange]",
    "UR10": (
        "Tz(0.1273) Rz(q1) Ty(0.1639) Ry(q2) Tx(0.612) Ry(q3) Tx(0.5723) Ry(q4) Rz(q5) Tz(-0.1157) Ry(q6) Ty(0.0922) [flange]"
    ),
    "offsets that fold back, as a UR5's": (
        "Tz(0.089) Rz(q1) Ty(0.136) Ry(q2) Tz(0.425) Ty(-0.12) Ry(q3) Tz(0.392) Ry(q4) Ty(0.093) Rz(q5) Tz(0.095) Ry(q6) [tip]"
    ),
}


def from_file(name):
    return robot_from_document(read_document(ROBOTS / f"{name}.yaml"))


def from_chain(chain):
    joints = sum(word.startswith("R") and "q" in word for word in chain.split())
    known = {"joint_limits_deg": [[-180, 180]] * joints, "compliance_urad_per_Nm": [1.0] * joints}
    return robot_from_document({"name": "made up", "chain": chain, **known})


def texts(figure):
    return [artist.get_text() for artist in figure.findobj(Text) if artist.get_text()]


def labels(figure):
    return {artist.get_gid(): artist.get_text() for artist in figure.findobj(Text) if artist.get_gid()}


def assert_no_overlap(figure):
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    shown = [artist for artist in figure.findobj(Text) if artist.get_text()]
    framed = figure.findobj(lambda artist: str(artist.get_gid()).endswith("-box"))
    boxes = [(artist.get_text(), artist.get_window_extent(renderer)) for artist in shown]
    frames = [(artist.get_gid(), artist.get_window_extent(renderer)) for artist in framed]
    for (one, first), (other, second) in [*combinations(boxes, 2), *combinations(frames, 2)]:
        assert not first.overlaps(second), f"{one!r} on {other!r}"
    for text, box in boxes:
        assert figure.bbox.contains(*box.min) and figure.bbox.contains(*box.max), f"{text!r} is cut off"


def test_kinematic_scheme_names_all_of_kuka():
    lengths = ("675", "350", "1150", "\N{MINUS SIGN}41", "1200", "240")
    expected = {f"joint-{n}": f"$q_{{{n}}}$" for n in range(1, 7)}
    expected |= {f"length-{n}": f"$l_{{{n}}}$ = {length} mm" for n, length in enumerate(lengths, start=1)}
    expected |= {f"point-{name}": name for name in ("2DoF", "3DoF", "4DoF", "6DoF")}
    figure = kinematic_scheme(from_file("kuka"))
    assert labels(figure) == expected
    assert {"base frame", "$x$", "$z$"} <= set(texts(figure))


@pytest.mark.parametrize("name", ["kuka", "fanuc", "kuka_extended"])
def test_texts_of_robots_do_not_overlap(name):
    robot = from_file(name)
    assert_no_overlap(kinematic_scheme(robot))
    assert_no_overlap(spring_scheme(robot))


@pytest.mark.parametrize("chain", CHAINS.values(), ids=CHAINS)
def test_any_serial_chain_draws(chain):
    robot = from_chain(chain)
    figure = kinematic_scheme(robot)
    assert {f"joint-{n}" for n in range(1, robot.joints + 1)} <= set(labels(figure))
    assert_no_overlap(figure)
    assert_no_overlap(spring_scheme(robot))


def test_targets_off_the_chain_draw_apart_from_it():
    assert_no_overlap(kinematic_scheme(with_target_offset(from_file("fanuc"), (0.0, 0.1, 0.05))))


def test_spring_scheme_has_a_spring_for_each_joint_and_each_elastic_link():
    reduced, extended = texts(spring_scheme(from_file("kuka"))), texts(spring_scheme(from_file("kuka_extended")))
    for joint in range(1, 7):
        spring = f"$q_{{{joint}}}$ + $\\theta_{{{joint}}}$"
        assert (reduced.count(spring), extended.count(spring)) == (1, 2)
    # One more in the legend.
    assert (reduced.count("6D"), extended.count("6D")) == (0, len(from_file("kuka_extended").links) + 1)


def test_schemes_are_about_160_mm_wide_and_drawn_alike_each_time():
    for scheme in (kinematic_scheme, spring_scheme):
        first, second = scheme(from_file("kuka_extended")), scheme(from_file("kuka_extended"))
        assert first.get_figwidth() * 25.4 == pytest.approx(160, abs=2)
        assert bytes(FigureCanvasAgg(first).print_to_buffer()[0]) == bytes(FigureCanvasAgg(second).print_to_buffer()[0])
