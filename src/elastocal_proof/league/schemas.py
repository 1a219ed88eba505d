"""Tables that the benchmark keeps, column by column."""

from elastocal.io.storage import Column, TableSchema

_FOLD = Column(
    "fold",
    "int32",
    "",
    "number of the fold whose poses are held out, from 1",
    minimum=1,
)
_POSE = (
    Column("session", "int32", "", "session of the pose"),
    Column("pose", "int32", "", "number of the pose in its session"),
)

FOLDS = TableSchema(
    "folds",
    (
        *_POSE,
        Column(
            "random",
            "int32",
            "",
            "fold of the random split that holds the pose out, from 1",
            minimum=1,
        ),
        Column(
            "blocks",
            "int32",
            "",
            "block of joint space that holds the pose, from 1",
            minimum=1,
        ),
    ),
)

MECHANISMS = TableSchema(
    "mechanisms",
    (
        _FOLD,
        Column("mechanism", "text", "", "name in the catalogue of effects"),
        Column(
            "probability",
            "float64",
            "",
            "posterior probability that it acts",
            minimum=0,
        ),
        Column(
            "share",
            "float64",
            "",
            "of the sum of squares that geometry leaves, in the most probable model",
            minimum=0,
        ),
    ),
)

ENTRIES = TableSchema(
    "entries",
    (
        _FOLD,
        Column(
            "set",
            "int32",
            "",
            "number of the data set that is the test, 0 where it is a part of the same",
            minimum=0,
        ),
        *_POSE,
        Column("load", "int32", "", "number of the load, 0 where unloaded"),
        Column("target", "int32", "", "number of the target, from 0", minimum=0),
        *(
            Column(
                f"d{axis}",
                "float64",
                "m",
                f"measured less predicted along {axis}, base axes",
            )
            for axis in "xyz"
        ),
        *(
            Column(
                f"std_{axis}",
                "float64",
                "m",
                f"standard deviation stated along {axis}",
                missing=True,
            )
            for axis in "xyz"
        ),
    ),
)
