"""Every table that the loop keeps, column by column. Written down here and nowhere else."""

from elastocal.storage import Column, TableSchema
from elastocal.table_schemas import COMPONENTS, WRENCH

_IDENTITY = (
    Column("session", "int32", "", "sessions have each their own tracker frame"),
    Column("pose", "int32", "", "number of the pose in its session"),
    Column("load", "int32", "", "number of the load, 0 where unloaded"),
    Column("repeat", "int32", "", "number of the fresh approach to this pose and load"),
    Column("target", "int32", "", "number of the target, in the order of the campaign, from 0", minimum=0),
    Column("row", "int32", "", "row in the file of measurements, 1 for the first of data", minimum=1),
)
_CANDIDATE = (
    Column("candidate", "text", "", "effect @ joints [variant]"),
    Column("effect", "text", "", "name in the catalogue"),
    Column("family", "text", "", "family in the catalogue"),
    Column("joints", "text", "", "joints concerned, from 1, joined by +"),
)


def _angles_and_wrench(joints):
    return (
        *(Column(f"q{j}", "float64", "rad", f"angle of joint {j} of the chain") for j in range(1, joints + 1)),
        *(Column(name, "float64", unit, f"{meaning}, at the last measuring point") for name, unit, meaning in WRENCH),
    )


def readings(joints):
    """Readings of a campaign, as the library takes them; what was not recorded is not a number."""
    return TableSchema(
        "readings",
        (
            *_IDENTITY,
            *_angles_and_wrench(joints),
            *(Column(axis, "float64", "m", f"measured position along {axis}") for axis in "xyz"),
            *(Column(f"r{axis}", "float64", "rad", f"measured rotation vector about {axis}", missing=True) for axis in "xyz"),
            *(
                Column(f"approach{j}", "float64", "", f"sense of approach of joint {j}", missing=True)
                for j in range(1, joints + 1)
            ),
            Column("time_s", "float64", "s", "time since any instant", missing=True),
            Column("temperature_c", "float64", "°C", "temperature", missing=True),
        ),
    )


PARAMETERS = TableSchema(
    "parameters",
    (
        Column("owner", "text", "", "frame of a session, target, effect, or the fit itself"),
        Column("parameter", "text", "", "name of the parameter"),
        Column("unit", "text", "", "unit of value, standard error and prior"),
        Column("value", "float64", "", "estimate; placement of the base for frames, of the target in its point for targets"),
        Column("std_error", "float64", "", "standard error; 0 where held", missing=True),
        Column("held", "bool", "", "whether these data cannot tell the parameter, which keeps its value"),
        Column("prior_std", "float64", "", "standard deviation of the normal prior about zero, if there is one", missing=True),
    ),
)

CORRELATIONS = TableSchema(
    "correlations",
    (
        Column("one", "text", "", "owner and name of a parameter"),
        Column("other", "text", "", "owner and name of another"),
        Column("correlation", "float64", "", "of their estimates"),
    ),
)

LOOKS = TableSchema(
    "looks",
    (
        Column("look", "int32", "", "number of the look at all candidates, from 0", minimum=0),
        *_CANDIDATE,
        Column("shape", "float64", "", "value of the shape parameter, where there is one", missing=True),
        Column("parameters", "int32", "", "directions in which the candidate can be told", minimum=0),
        Column("statistic", "float64", "", "squared length of the whitened residual along them", missing=True),
        Column("p_value", "float64", "", "of this test alone", missing=True),
        Column("p_family", "float64", "", "of the smallest p-value of all candidates, by a bootstrap over poses", missing=True),
        Column("bic_gain", "float64", "", "by how much the extended Bayesian criterion falls", missing=True),
        Column(
            "heldout_gain", "float64", "", "cross-validated fall of the squared whitened error; first look only", missing=True
        ),
        Column("heldout_gain_std_error", "float64", "", "its standard error over poses", missing=True),
        Column("retained", "float64", "", "share of the sensitivities that the model does not make itself", missing=True),
        Column("noncentrality", "float64", "", "of the test if the effect had its plausible size", missing=True),
        Column("chosen", "bool", "", "whether this look took the candidate"),
        Column("note", "text", "", "why it was not tested, or refused"),
    ),
)

CANDIDATES = TableSchema(
    "candidates",
    (
        *(column for column in LOOKS.columns if column.name not in ("look", "chosen")),
        Column("chosen", "bool", "", "whether any look took the candidate"),
        Column("angle_deg", "float64", "deg", "angle of its sensitivities to the nearest effect found", missing=True),
    ),
)

FOUND = TableSchema(
    "found",
    (
        *_CANDIDATE,
        Column("p_family", "float64", "", "when it was chosen"),
        Column("gain", "float64", "", "cross-validated fall of the squared whitened error on left-out poses"),
        Column("gain_std_error", "float64", "", "its standard error over poses"),
    ),
)

RIVALS = TableSchema(
    "rivals",
    (
        Column("found", "text", "", "name of the effect found"),
        Column("candidate", "text", "", "what might stand in its place"),
        Column("angle_deg", "float64", "deg", "angle of its sensitivities to what was found"),
        Column("bic_difference", "float64", "", "by how much the Bayesian criterion is worse with it"),
        Column("parameters", "int32", "", "directions in which it can be told"),
        Column("found_parameters", "int32", "", "directions in which what was found can be told"),
        Column("alternative", "bool", "", "whether these data cannot tell it from what was found"),
    ),
)

CONFOUNDING = TableSchema(
    "confounding",
    (
        Column("one", "text", "", "candidate"),
        Column("other", "text", "", "candidate"),
        Column("angle_deg", "float64", "deg", "smallest angle between what they make off the declared model"),
    ),
)


def residuals(joints):
    """Every reading, before and after."""
    return TableSchema(
        "residuals",
        (
            *_IDENTITY,
            Column("held_out", "bool", "", "whether no step but the last has seen it"),
            Column("outside_range", "bool", "", "whether its held-out pose lies outside the range of the fitted poses"),
            Column("time_s", "float64", "s", "time since any instant", missing=True),
            *_angles_and_wrench(joints),
            *(Column(axis, "float64", "m", f"measured position along {axis}, base axes") for axis in "xyz"),
            *(
                Column(f"{stage}_{name}", "float64", unit, f"{meaning}, measured less predicted, {words}", missing=True)
                for stage, words in (("before", "declared model"), ("after", "with the effects found"))
                for name, unit, meaning in COMPONENTS
            ),
        ),
    )
