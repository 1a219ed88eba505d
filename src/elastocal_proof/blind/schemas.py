"""Columns of the table that the closed loop writes."""

from elastocal.io.storage import Column, TableSchema


def build_closed_loop_schema(joints: int) -> TableSchema:
    """Build the schema of the table of commanded poses, with the error of each."""
    return TableSchema(
        "closed_loop",
        (
            Column("effect", "text", "", "hidden effect of the robot"),
            Column("seed", "int32", "", "seed of the case"),
            Column("verdict", "text", "", "verdict of the diagnosis"),
            Column(
                "named",
                "bool",
                "",
                "whether the verdict names the effect, alone or with others, and the model has it",
            ),
            Column(
                "part",
                "text",
                "",
                "unloaded, loaded, or milling: a path under the process force",
            ),
            Column("model", "text", "", "model that corrected the targets"),
            Column("pose", "int32", "", "number of the wanted pose"),
            *(
                Column(f"q{j}", "float64", "rad", f"commanded angle of joint {j}")
                for j in range(1, joints + 1)
            ),
            Column(
                "reached_error_m",
                "float64",
                "m",
                "distance of the pose that the robot reached from the wanted position",
            ),
            Column(
                "measured_error_m",
                "float64",
                "m",
                "the same distance as the tracker measures it",
            ),
            Column(
                "predicted_std_m",
                "float64",
                "m",
                "root mean square error that the model states; 0 without a model",
            ),
            Column(
                "corrected",
                "bool",
                "",
                "whether the target could be corrected within limits and off singular postures",
            ),
        ),
    )
