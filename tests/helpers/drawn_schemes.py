"""Robots to draw schemes of, from their files and from chains in one line, and what holds for every scheme."""

from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from elastocal.io.documents import read_document
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


DRAWN = {name: from_file(name) for name in ("kuka", "fanuc", "kuka_extended")}
DRAWN |= {name: from_chain(chain) for name, chain in CHAINS.items()}


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


def assert_about_160_mm_wide_and_drawn_alike(scheme):
    first, second = scheme(DRAWN["kuka_extended"]), scheme(DRAWN["kuka_extended"])
    assert first.get_figwidth() * 25.4 == pytest.approx(160, abs=2)
    assert bytes(FigureCanvasAgg(first).print_to_buffer()[0]) == bytes(FigureCanvasAgg(second).print_to_buffer()[0])
