"""Tables are read as data frames, and data frames are written for readers."""

import numpy as np
import pandas as pd

from elastocal.io.data_frames import (
    read_frame,
    read_robot_tables,
    write_csv,
    write_latex,
    write_markdown,
)
from elastocal.io.origin import Origin
from elastocal.io.storage import Column, TableSchema, write_table

ORIGIN = Origin("c0ffee", "d16e57", 7)


def test_written_tables_escape_latex_commands_and_name_their_origin(
    tmp_path,
):
    frame = pd.DataFrame({"k_sigma_percent": ["1.0 ± 0.1"], "µm": ["5 %"]})
    write_latex(tmp_path / "t.tex", frame, ORIGIN)
    write_markdown(tmp_path / "t.md", frame, ORIGIN)
    write_csv(tmp_path / "t.csv", pd.DataFrame({"x": [0.1, np.inf]}))
    latex, markdown = (
        (tmp_path / f"t.{kind}").read_text(encoding="utf-8") for kind in ("tex", "md")
    )
    assert r"k\_sigma\_percent" in latex and "1.0 ± 0.1" in latex and r"5 \%" in latex
    assert latex.splitlines()[-1] == f"% {ORIGIN.words}"
    assert "| 1.0 ± 0.1" in markdown and markdown.splitlines()[-2:] == [
        "",
        f"<!-- {ORIGIN.words} -->",
    ]
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == "x\n0.1\ninf\n"


ANGLES = TableSchema("angles", (Column("q{joint}", "float64", "rad", "an angle"),))


def test_tables_of_several_robots_start_with_their_origin_and_lack_no_column(
    tmp_path,
):
    paths = []
    for robot, joints, noise in (("big", 3, "200"), ("small", 2, "12.5")):
        paths.append(tmp_path / f"{robot}.parquet")
        settings = {
            "robot": {"compliance_urad_per_Nm": [1.0] * joints},
            "strategy": {"name": f"of {robot}"},
        }
        columns = {
            f"q{joint}": np.array([0.1 * joint, 0.2 * joint])
            for joint in range(1, joints + 1)
        }
        write_table(
            paths[-1],
            ANGLES.for_joints(joints),
            [columns],
            {"robot": robot, "noise": noise, "configuration": settings},
        )
    frame = read_robot_tables(paths, ANGLES)
    assert frame.index.tolist() == [0, 1, 2, 3] and frame.robot.tolist() == [
        "big",
        "big",
        "small",
        "small",
    ]
    assert (
        frame.strategy.tolist() == ["of big"] * 2 + ["of small"] * 2
        and frame.noise_um.tolist() == [200.0] * 2 + [12.5] * 2
    )
    np.testing.assert_allclose(frame.q2, [0.2, 0.4, 0.2, 0.4])
    np.testing.assert_allclose(frame.q3, [0.3, 0.6, np.nan, np.nan])
    assert read_frame(paths[0], ANGLES.for_joints(3), ["q2"]).columns.tolist() == ["q2"]
