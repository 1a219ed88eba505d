"""Tables that the closed loop and the proof of bad rows keep, column by column."""

from elastocal.io.storage import Column, TableSchema

_VERSIONS = {
    "clean": "the clean file",
    "damaged": "the file with bad rows",
    "fewer": "the clean file with as many rows deleted",
}
BAD_ROWS = TableSchema(
    "bad_rows",
    (
        Column("seed", "int32", "", "of the case, each slip of which is a row"),
        Column("poses", "int32", "", "of the campaign"),
        Column("rows", "int32", "", "of the campaign"),
        Column("loads", "int32", "", "at which each pose is measured, none among them"),
        Column("targets", "int32", "", "measuring points with a target each"),
        Column("measured", "text", "", "pose or position"),
        Column("frame", "text", "", "base, or tracker: placement and target offsets unknown"),
        Column("noise", "text", "", "declared, or from repeats"),
        Column("covariates", "bool", "", "whether approach, time and temperature are recorded"),
        Column("mixture", "text", "", "what kind of truth was drawn"),
        Column("truth", "text", "", "what the robot has, with joints"),
        Column("clean_rows_lost", "int32", "", "rows of the clean file that are named as gross errors"),
        Column("wrongly_named", "int32", "", "good rows of the damaged file that are named as gross errors"),
        *(
            column
            for version, words in _VERSIONS.items()
            for column in (
                Column(f"{version}_verdict", "text", "", f"on {words}; refused where a line refuses it"),
                Column(f"{version}_found", "text", "", f"mechanisms in {words}"),
                Column(f"{version}_found_at", "text", "", f"mechanisms in {words} with their joints"),
                Column(f"{version}_heldout_rms_m", "float64", "m", f"held-out position error of {words}", missing=True),
            )
        ),
        Column("kind", "text", "", "of the slip"),
        Column("bad_rows", "text", "", "rows of the file in which something is wrong, 1 for the first of data"),
        Column("held_out", "bool", "", "whether these are held out"),
        Column("size", "float64", "", "of the row that contradicts the robot most, in standard deviations of the tracker"),
        Column("named", "bool", "", "whether these rows are named as gross errors"),
    ),
)


def closed_loop(joints: int) -> TableSchema:
    """Every wanted pose, what it was commanded as, and how far the robot missed it."""
    return TableSchema(
        "closed_loop",
        (
            Column("effect", "text", "", "what the robot has and nobody declared"),
            Column("seed", "int32", "", "of the case"),
            Column("verdict", "text", "", "of the diagnosis"),
            Column("named", "bool", "", "whether the verdict names the effect, alone or with others, and the model has it"),
            Column("part", "text", "", "unloaded, loaded, or milling: a path under the process force"),
            Column("model", "text", "", "by which the targets were corrected"),
            Column("pose", "int32", "", "number of the wanted pose"),
            *(Column(f"q{j}", "float64", "rad", f"commanded angle of joint {j}") for j in range(1, joints + 1)),
            Column("reached_error_m", "float64", "m", "distance of where the robot came to rest from the wanted position"),
            Column("measured_error_m", "float64", "m", "the same as the tracker measures it"),
            Column("predicted_std_m", "float64", "m", "root mean square error that the model states; 0 without a model"),
            Column("corrected", "bool", "", "whether the target could be corrected within limits and off singular postures"),
        ),
    )
