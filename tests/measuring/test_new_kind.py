"""A new kind of measurement is one class: a draw wire over a pulley, in this file."""

from typing import ClassVar

import numpy as np
import pytest
from contact_campaigns import (
    TOOL_M,
    count_std_errors,
    fit_contacts,
    open_workshop,
    write_contacts,
)

from elastocal.measuring import catalogue
from elastocal.measuring.protocol import Kind, Unknown, predict_along, read_vector

PULLEY_M = 0.02
ANCHORS = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.5], [0.5, -1.2, 0.2]])


class DrawWire(Kind):
    """Length of a wire that leaves a pulley, m: straight wire less the unknown zero."""

    name = "draw_wire"
    meaning = "length of a wire that leaves a pulley of 20 mm at an anchor"
    numbers = 1
    columns = ("value",)
    keys: ClassVar = {"position_m": "middle of the pulley, roughly, or unknown"}

    def unknowns(self, feature):
        """List the middle of the pulley and the zero."""
        return tuple(Unknown(name, "m", 1.0) for name in ("x", "y", "z", "zero"))

    def start(self, feature, position, numbers):
        """Start at the stated middle."""
        return np.array([*read_vector(feature, "position_m"), 0.0])

    def evaluate(self, position, rotation, numbers, values):
        """Predict the straight part of the wire, a tangent of the pulley."""
        from_middle = position - values[:3]
        length = np.sqrt((from_middle**2).sum(axis=1) - PULLEY_M**2)
        direction = from_middle / length[:, None]
        by_unknowns = np.column_stack([-direction, np.ones(len(length))])
        return predict_along(numbers[:, 0] - length - values[3], direction, by_unknowns)


@pytest.fixture
def installed(monkeypatch):
    """The kind in the catalogue, as an entry point puts it there."""
    kinds = catalogue.list_kinds() | {"draw_wire": DrawWire()}
    monkeypatch.setattr("elastocal.measuring.channels.list_kinds", lambda: kinds)
    monkeypatch.setattr("elastocal.fitting.features.list_kinds", lambda: kinds)
    monkeypatch.setattr("elastocal.fitting.least_squares.list_kinds", lambda: kinds)


@pytest.mark.usefixtures("installed")
def test_a_draw_wire_over_a_pulley_calibrates_a_robot(tmp_path):
    workshop = open_workshop(4)
    rows = []
    for row in range(90):
        angles = workshop.draw_angles()
        distance = np.linalg.norm(workshop.find_tool(angles)[0] - ANCHORS[row % 3])
        wire = np.sqrt(distance**2 - PULLEY_M**2) + 0.1
        noise = 5e-5 * workshop.draws.standard_normal()
        rows.append({"angles": angles, "feature": f"w{row % 3}", "value": wire + noise})
    features = {
        f"w{number}": {"position_m": (anchor + 0.01).tolist()}
        for number, anchor in enumerate(ANCHORS)
    }
    document = {"measured": "draw_wire", "features": features}
    document["noise"] = {"position_m": 5e-5}
    fitted = fit_contacts(write_contacts(tmp_path / "cell", document, rows))
    assert fitted.converged
    assert np.abs(count_std_errors(fitted)).max() < 4.0
    np.testing.assert_allclose(fitted.estimate.target_offset[0], TOOL_M, atol=3e-4)
