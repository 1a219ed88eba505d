"""Frames on a robot: each has its axes and its name."""

import numpy as np
from drawn_figures import legend_entries

from elastocal.exchange.dh_writing import dh_frames
from elastocal.figures.dh_frames import dh_frames_picture


def test_each_frame_has_three_axes_and_a_name(kuka):
    frames = dh_frames(kuka)
    names = [str(number) for number in range(len(frames))]
    figure = dh_frames_picture(frames, kuka.name, names)
    (axis,) = figure.axes
    assert len(axis.lines) == 1 + 3 * len(frames)
    assert sorted(", ".join(text.get_text() for text in axis.texts).split(", ")) == sorted(names)
    assert any("4, 5" in text.get_text() for text in axis.texts), "frames of the wrist share an origin"
    assert legend_entries(figure) == ["x axis", "y axis", "z axis"]
    line = np.array(axis.lines[0].get_data_3d()).T
    np.testing.assert_allclose(line[1:], frames[:, :3, 3])
