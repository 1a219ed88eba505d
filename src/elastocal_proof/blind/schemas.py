"""The table that the closed loop keeps, column by column."""

from elastocal.io.storage import Column, TableSchema


def build_closed_loop_schema(joints: int) -> TableSchema:
    """Every wanted pose, what it was commanded as, and how far the robot missed it."""
    return TableSchema(
        "closed_loop",
        (
            Column("effect", "text", "", "what the robot has and nobody declared"),
            Column("seed", "int32", "", "of the case"),
            Column("verdict", "text", "", "of the diagnosis"),
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
            Column("model", "text", "", "by which the targets were corrected"),
            Column("pose", "int32", "", "number of the wanted pose"),
            *(
                Column(f"q{j}", "float64", "rad", f"commanded angle of joint {j}")
                for j in range(1, joints + 1)
            ),
            Column(
                "reached_error_m",
                "float64",
                "m",
                "distance of where the robot came to rest from the wanted position",
            ),
            Column(
                "measured_error_m",
                "float64",
                "m",
                "the same as the tracker measures it",
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
