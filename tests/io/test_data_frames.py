"""Tables as data frames, and data frames as tables for people."""

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_frame, read_long, write_csv, write_latex, write_markdown
from elastocal.io.origin import Origin
from elastocal.io.storage import Column, TableSchema, write_table

SCHEMA = TableSchema("things", (Column("number", "int32", "", "a number"), Column("length", "float64", "m", "a length")))


def test_tables_for_people_escape_what_latex_would_take_for_commands(tmp_path):
    frame = pd.DataFrame({"k_sigma_percent": ["1.0 ± 0.1"], "µm": ["5 %"]})
    write_latex(tmp_path / "t.tex", frame)
    write_markdown(tmp_path / "t.md", frame)
    write_csv(tmp_path / "t.csv", pd.DataFrame({"x": [0.1, np.inf]}))
    text = (tmp_path / "t.tex").read_text(encoding="utf-8")
    assert r"k\_sigma\_percent" in text and "1.0 ± 0.1" in text and r"5 \%" in text
    assert "| 1.0 ± 0.1" in (tmp_path / "t.md").read_text(encoding="utf-8")
    assert (tmp_path / "t.csv").read_text(encoding="utf-8") == "x\n0.1\ninf\n"
    assert not list(tmp_path.glob("*.partial"))


def test_a_table_for_people_names_its_origin_where_its_readers_do_not_see_it(tmp_path):
    origin = Origin("c0ffee", "d16e57", 7)
    write_latex(tmp_path / "t.tex", pd.DataFrame({"a": ["1"]}), origin)
    write_markdown(tmp_path / "t.md", pd.DataFrame({"a": ["1"]}), origin)
    assert (tmp_path / "t.tex").read_text(encoding="utf-8").splitlines()[-1] == f"% {origin.words}"
    assert (tmp_path / "t.md").read_text(encoding="utf-8").splitlines()[-2:] == ["", f"<!-- {origin.words} -->"]


def test_a_frame_has_the_columns_asked_for_in_the_order_of_the_schema(tmp_path):
    write_table(tmp_path / "t.parquet", SCHEMA, [{"number": np.array([3, 1]), "length": np.array([0.5, 0.25])}], {})
    frame = read_frame(tmp_path / "t.parquet", SCHEMA)
    assert list(frame) == ["number", "length"]
    assert frame.to_numpy().tolist() == [[3, 0.5], [1, 0.25]]
    assert list(read_frame(tmp_path / "t.parquet", SCHEMA, ["length"])) == ["length"]


def per_joint(joints):
    return TableSchema("angles", tuple(Column(f"q{joint}", "float64", "rad", "an angle") for joint in range(1, joints + 1)))


def test_tables_of_many_robots_are_headed_by_their_origin_and_empty_where_joints_lack(tmp_path):
    paths = []
    for robot, joints, noise in (("big", 3, "200"), ("small", 2, "12.5")):
        paths.append(tmp_path / f"{robot}.parquet")
        settings = {"robot": {"compliance_urad_per_Nm": [1.0] * joints}, "strategy": {"name": f"of {robot}"}}
        columns = {f"q{joint}": np.array([0.1 * joint, 0.2 * joint]) for joint in range(1, joints + 1)}
        write_table(paths[-1], per_joint(joints), [columns], {"robot": robot, "noise": noise, "configuration": settings})
    frame = read_long(paths, per_joint)
    assert frame.index.tolist() == [0, 1, 2, 3]
    assert frame.robot.tolist() == ["big", "big", "small", "small"]
    assert frame.strategy.tolist() == ["of big", "of big", "of small", "of small"]
    assert frame.noise_um.tolist() == [200.0, 200.0, 12.5, 12.5]
    np.testing.assert_allclose(frame.q2, [0.2, 0.4, 0.2, 0.4])
    np.testing.assert_allclose(frame.q3, [0.3, 0.6, np.nan, np.nan])
