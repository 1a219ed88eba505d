"""The figure of the closed loop has a marker for each robot and model in each part."""

import pandas as pd
from drawn_figures import legend_entries, row_labels

from elastocal_proof.blind.closed_loop import MODELS, PARTS
from elastocal_proof.figures.closed_loop import closed_loop


def test_every_error_is_drawn_where_its_model_stands():
    rows = [
        {"robot": robot, "part": part, "model": model, "rms_mm": 1.0 + number, "rms_mm_low": 0.9, "rms_mm_high": 6.0}
        for robot in ("gp180", "kuka", "all")
        for part in PARTS
        for number, model in enumerate(MODELS)
    ]
    figure = closed_loop(pd.DataFrame(rows))
    assert [axis.get_title() for axis in figure.axes] == ["unloaded", "under loads", "milling path"]
    assert legend_entries(figure) == ["gp180", "kuka"]
    words = row_labels(figure.axes[0])
    assert words[0] == "uncorrected" and words[-1].startswith("true model")
    drawn = figure.axes[0].containers[0].lines[0]
    assert drawn.get_xdata().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert (pd.Series(drawn.get_ydata()).diff().dropna() < 0).all()
