"""The picture of README has the errors of the held-out rows alone, before and after, and states their RMS."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.figures.arm_view import project_view
from elastocal.figures.hero import arm_with_errors


@pytest.fixture
def table():
    rng = np.random.default_rng(1)
    columns = {f"q{joint}": rng.uniform(-1, 1, 12) for joint in range(1, 7)}
    columns |= {
        f"{stage}_d{axis}": size * rng.standard_normal(12)
        for stage, size in (("before", 1e-3), ("after", 1e-4))
        for axis in "xyz"
    }
    return columns | {axis: rng.uniform(-2, 2, 12) for axis in "xyz"} | {"held_out": np.arange(12) % 3 == 0}


def test_each_panel_has_its_errors_and_their_rms(table):
    heldout = {"before": {"rms_m": 1.23e-3}, "after": {"rms_m": 0.12e-3}, "poses": 4, "noise_floor_rms_m": 0.105e-3}
    figure = arm_with_errors(analysed("kuka"), table, heldout)
    assert [axis.get_title(loc="left") for axis in figure.axes] == ["1.23 mm", "0.12 mm"]
    for axis, stage in zip(figure.axes, ("before", "after"), strict=True):
        (arrows,) = [found for found in axis.collections if found.get_gid() == stage]
        off = np.column_stack([table[f"{stage}_d{each}"] for each in "xyz"])[::3]
        drawn = np.column_stack([arrows.U, arrows.V])
        times = np.linalg.norm(drawn) / np.linalg.norm(project_view(off))
        np.testing.assert_allclose(drawn, times * project_view(off), atol=1e-12)
        assert times == pytest.approx(400)
    assert "4 held-out poses" in figure.get_supxlabel() and "400 times" in figure.get_supxlabel()
