"""Every table that the study keeps, column by column: name, type, unit, meaning. Written down here and nowhere else."""

from elastocal.io.storage import Column, TableSchema
from elastocal.mechanics.components import COMPONENTS, WRENCH

_SET = Column("data_set", "int32", "", "number of the data set, from 0", minimum=0)
_CONFIGURATION = Column("configuration", "int32", "", "number of the configuration in its data set, from 0", minimum=0)
_LENGTH = Column("length", "int32", "", "data set length ds: how many configurations, from the first, were used", minimum=1)


def experiments(joints: int) -> TableSchema:
    """Configurations and wrenches; one row for each loaded configuration."""
    angles = [Column(f"q{j}", "float64", "rad", f"angle of joint {j}") for j in range(1, joints + 1)]
    wrench = [Column(name, "float64", unit, f"{meaning}, at the end-effector") for name, unit, meaning in WRENCH]
    return TableSchema("experiments", (_SET, _CONFIGURATION, *angles, *wrench))


DEFLECTIONS = TableSchema(
    "deflections",
    (
        Column("point", "string", "", "measuring point; a row group holds one"),
        _SET,
        _CONFIGURATION,
        *(Column(name, "float64", unit, f"{meaning}, loaded against unloaded") for name, unit, meaning in COMPONENTS),
    ),
)


def covariance_columns(joints: int) -> list[tuple[str, int, int]]:
    """(name, row, column) of the lower triangle of the covariance of the compliances."""
    return [(f"cov_{i + 1}_{j + 1}", i, j) for i in range(joints) for j in range(i + 1)]


def design(joints: int) -> TableSchema:
    """What a strategy can identify from the experiments, whatever the noise; one row for each data set and length."""
    covariances = [
        Column(name, "float32", "1/(N m)^2", f"covariance of c{i + 1} and c{j + 1} for unit measurement variance", missing=True)
        for name, i, j in covariance_columns(joints)
    ]
    condition = Column("condition", "float32", "", "condition number of the identification Jacobian, worst stage", missing=True)
    return TableSchema("design", (_SET, _LENGTH, *covariances, condition))


def identified(joints: int) -> TableSchema:
    """What a strategy identified; one row for each data set and length."""
    compliances = [
        Column(f"c{j}", "float64", "rad/(N m)", f"identified compliance of joint {j}", missing=True)
        for j in range(1, joints + 1)
    ]
    return TableSchema("identified", (_SET, _LENGTH, *compliances))


def metrics(joints: int) -> TableSchema:
    """Equations 12-15, averaged over the data sets; one row for each length."""
    columns = [_LENGTH]
    for j in range(1, joints + 1):
        columns += _with_error(f"compliance_{j}", "rad/(N m)", f"inverse of the averaged stiffness of joint {j} (equation 12)")
    for j in range(1, joints + 1):
        columns += _with_error(
            f"delta_k_{j}", "percent", f"relative error of the averaged stiffness of joint {j} (equation 13)"
        )
    columns += _with_error("k_sigma", "percent", "sum of delta_k over all joints (equation 14)")
    columns += _with_error(
        "k_sigma_fixed_joints", "percent", "sum of delta_k over the joints fixed in the last stage (interpretation R10)"
    )
    columns += _with_error(
        "deviation", "m", "mean end-effector error of the averaged model on test configurations (equation 15)"
    )
    columns += _with_error("initial_deviation", "m", "mean deflection of the end-effector on the test configurations")
    columns += [
        Column("nonpositive_share", "float64", "", "share of data sets with a compliance that is not positive"),
        Column(
            "relative_spread", "float64", "", "largest standard deviation over mean of an identified compliance", missing=True
        ),
        Column("trustworthy", "bool", "", "whether the mean of 1/c exists in practice: none <= 0 and relative spread <= 0.25"),
    ]
    return TableSchema("metrics", tuple(columns))


def _scores(joints: int) -> list[Column]:
    """Scores of the averaged model, without errors."""
    compliances = [
        Column(f"compliance_{j}", "float64", "rad/(N m)", f"as in the metrics, of joint {j}", missing=True)
        for j in range(1, joints + 1)
    ]
    return [
        *compliances,
        Column("k_sigma", "float64", "percent", "as in the metrics", missing=True),
        Column("k_sigma_fixed_joints", "float64", "percent", "as in the metrics", missing=True),
        Column("deviation", "float64", "m", "as in the metrics", missing=True),
    ]


def repeated(joints: int) -> TableSchema:
    """Scores of further studies of the same size; one row for each study, strategy and length."""
    study = Column("study", "int32", "", "number of the study, from 1; that of the tables is number 0", minimum=1)
    strategy = Column("strategy", "string", "", "name of the strategy")
    other = "by the mean of the compliances where the metrics have that of the stiffnesses"
    more = (
        Column("k_sigma_mean_compliance", "float64", "percent", f"sum of delta_k over all joints, {other}", missing=True),
        Column(
            "k_sigma_fixed_joints_mean_compliance", "float64", "percent", f"the same of the fixed joints, {other}", missing=True
        ),
        Column("deviation_mean_compliance", "float64", "m", f"deviation {other}", missing=True),
        Column(
            "deviation_signed",
            "float64",
            "m",
            "position error with its sign, mean over data sets, configurations and coordinates",
            missing=True,
        ),
        Column("mean_square", "float64", "m^2", "mean square end-effector error of single data sets", missing=True),
    )
    return TableSchema("repeated", (study, strategy, _LENGTH, *_scores(joints), *more))


def expected(joints: int) -> TableSchema:
    """Expectations of the scores in closed form; one row for each length."""
    return TableSchema("expected", (_LENGTH, *_scores(joints)))


BUDGET = TableSchema(
    "budget",
    (
        Column("points", "string", "", "set of measuring points; a row group holds one"),
        _SET,
        _LENGTH,
        Column("mean_square", "float64", "m^2", "mean square end-effector error on test configurations", missing=True),
        Column("bound", "float64", "m^2", "Cramér-Rao bound of the same", missing=True),
    ),
)


FEW = TableSchema(
    "few",
    (
        Column("nominal_error", "float64", "", "standard deviation of the logarithm of nominal over true compliances"),
        Column("strategy", "string", "", "name of the strategy; a row group holds one"),
        _SET,
        _LENGTH,
        Column("mean_square", "float64", "m^2", "mean square end-effector error on test configurations", missing=True),
    ),
)

KINDS = TableSchema(
    "kinds",
    (
        Column("kind", "string", "", "what is measured; a row group holds one"),
        Column("scalars", "int32", "", "scalar measurements of one configuration", minimum=1),
        _SET,
        _LENGTH,
        Column("mean_square", "float64", "m^2", "mean square end-effector error on test configurations", missing=True),
    ),
)

LADDER = TableSchema(
    "ladder",
    (
        Column("noise", "float64", "m, rad", "standard deviation of the measurements"),
        _LENGTH,
        _SET,
        Column("link_springs", "int32", "", "number of link springs in the model", minimum=0),
        Column("added_link", "int32", "", "link whose spring came last, from 1; 0 where there is none", minimum=0),
        Column("chosen", "bool", "", "whether cross-validation stops here"),
        Column("mean_square", "float64", "m^2", "mean square end-effector error on test configurations"),
    ),
)

DESIGNS = TableSchema(
    "designs",
    (
        Column("joint_range", "text", "", "of candidates and validation configurations: full_turn or limits"),
        Column("design", "text", "", "criterion by which the configurations are chosen, random, or the bound of all designs"),
        Column("configurations", "int32", "", "configurations of the design", minimum=1),
        Column("rms", "float64", "m", "Cramér-Rao bound of the RMS end-effector error"),
        Column("low", "float64", "m", "5 % of random designs"),
        Column("high", "float64", "m", "95 % of random designs"),
    ),
)

SIMULATED_DESIGNS = TableSchema(
    "simulated_designs",
    (
        Column("load", "text", "", "kind of load: random directions, or one direction in every configuration"),
        Column("design", "text", "", "criterion by which the configurations are chosen, or random"),
        Column("configurations", "int32", "", "configurations of the design", minimum=1),
        Column("unobservable", "text", "", "joints that the loads do not move, from 1, with commas between them"),
        Column("rms", "float64", "m", "RMS end-effector error over simulated data sets on test configurations"),
        Column("std_error", "float64", "m", "Monte Carlo standard error of the same"),
        Column("there", "float64", "m", "RMS end-effector error at the test pose"),
    ),
)

STIFFNESS = TableSchema(
    "stiffness",
    (
        Column("force", "float64", "N", "magnitude of the load"),
        Column("softest", "float64", "N/m", "least translational stiffness, median over test configurations"),
        Column(
            "first_order", "float64", "percent", "distance of the first order from the exact kinematics over the displacement"
        ),
        Column("loaded", "float64", "percent", "distance of the exact kinematics from the equilibrium of the loaded arm"),
        Column("by_k_c", "float64", "percent", "distance of equation 6 from equation 8 over the displacement"),
        Column("bias", "float64", "percent", "largest relative bias of a compliance by equation 11 from arms in equilibrium"),
        Column("k_sigma", "float64", "percent", "sum over joints of the relative bias of the stiffness"),
        Column("offset_rank", "int32", "", "joints that one data set identifies without the offset of the force"),
        Column("rank", "int32", "", "the same with the offset"),
    ),
)

STARTS = TableSchema(
    "starts",
    (
        Column("start", "float64", "rad/(N m)", "where Gauss-Newton starts each joint"),
        Column("difference", "float64", "", "largest relative difference of a compliance from that of the first start"),
        Column("unsettled", "float64", "", "share of data sets whose steps do not settle"),
    ),
)

OBSERVABILITY = TableSchema(
    "observability",
    (
        _SET,
        *(Column(f"O{number}", "float64", "", f"observability index O{number}") for number in range(1, 6)),
        Column("bound", "float64", "m^2", "Cramér-Rao bound of the mean square end-effector error"),
        Column("mean_square", "float64", "m^2", "mean square end-effector error on test configurations"),
    ),
)


GEOMETRY = TableSchema(
    "geometry",
    (
        Column("estimator", "text", "", "what is identified from which poses"),
        Column("noise", "float64", "m", "RMS error of the loaded position by noise"),
        Column("leak", "float64", "m", "RMS error of the loaded position by what the estimator leaves out"),
        Column("compliance_noise", "float64", "percent", "relative standard deviation of the compliances, RMS over joints"),
        Column("compliance_leak", "float64", "percent", "relative leak of geometry into the compliances, RMS over joints"),
        Column("zero_noise", "float64", "rad", "standard deviation of the joint zeros, RMS over joints"),
        Column("zero_leak", "float64", "rad", "error of the joint zeros by what is left out, RMS over joints"),
    ),
)

WEIGHTING = TableSchema(
    "weighting",
    (
        Column("orientation_ratio", "float64", "rad/m", "noise of orientations over that of positions"),
        Column("per_metre", "float64", "m/m", "growth of the noise of positions with the tracker's range"),
        Column("equal", "float64", "m", "RMS error by equal weights"),
        Column("weighted", "float64", "m", "RMS error by the weights of the noise"),
    ),
)


USES = TableSchema(
    "uses",
    (
        Column("strategy", "string", "", "name of the strategy; a row group holds one"),
        _SET,
        Column("mean", "float64", "m", "mean end-effector error on test configurations"),
        Column("mean_square", "float64", "m^2", "mean square of the same"),
        Column("p95", "float64", "m", "95th percentile of the same"),
        Column("pooled_p95", "float64", "m", "95th percentile over test configurations and data sets, the same in every row"),
        Column("pooled_p95_influence", "float64", "m", "influence of the data set on the pooled percentile"),
        Column("iso_9283", "float64", "m", "largest error at the five poses of ISO 9283", missing=True),
        Column("path_mean_square", "float64", "m^2", "mean square error along the milling path", missing=True),
        Column("path_max", "float64", "m", "largest error along the milling path", missing=True),
    ),
)

PLACES = TableSchema(
    "places",
    (
        Column("joints", "int32", "", "joints that move the target", minimum=1),
        Column("along", "float64", "m", "way from the base along the chain"),
        Column("side", "text", "", "of the link, the flange, or a bar on the flange"),
        _SET,
        Column("bound", "float64", "m^2", "Cramér-Rao bound with the target beside the end-effector"),
        Column("bound_end_effector", "float64", "m^2", "the same of the end-effector in twice as many configurations"),
        Column("turned", "float64", "", "share of configurations in which a tracker sees a reflector turned to it"),
        Column("fixed", "float64", "", "the same of a reflector that stays as it is"),
    ),
)

TUBES = TableSchema(
    "tubes",
    (
        Column("diameter", "float64", "m", "outer diameter of the tubes"),
        _SET,
        Column("mean", "float64", "m", "mean over the data set of the end-effector's displacement under load"),
        Column("mean_square", "float64", "m^2", "mean square of the same"),
        Column("maximum", "float64", "m", "largest of the same"),
        Column("left", "float64", "m^2", "mean square end-effector error on test configurations, by joint springs alone"),
    ),
)


def accuracy(joints: int) -> TableSchema:
    """What one data set gives, as the mean over data sets; one row for each evaluated length."""
    columns = [_LENGTH]
    for name, meaning in (
        ("mean", "mean over test configurations of the end-effector position error"),
        ("rms", "root mean square over test configurations and data sets"),
        ("p95", "95th percentile over test configurations"),
        ("max", "largest over test configurations"),
    ):
        columns += _with_error(name, "m", meaning, over="data sets, for these test configurations")
    for j in range(1, joints + 1):
        columns += _with_error(
            f"relative_error_{j}", "percent", f"root mean square relative error of the compliance of joint {j}"
        )
    return TableSchema("accuracy", tuple(columns))


_REPLICATE = Column("replicate", "int32", "", "number of the bootstrap replicate, from 1", minimum=1)

WEIGHTS = TableSchema(
    "weights",
    (
        Column("members", "string", "", "what counts: data sets or test configurations; a row group holds one"),
        Column("number", "int32", "", "number of the data set or test configuration, from 0", minimum=0),
        _REPLICATE,
        Column("count", "int32", "", "how often it counts in the replicate", minimum=0),
    ),
)

REPLICATES = TableSchema(
    "replicates",
    (
        _REPLICATE,
        _LENGTH,
        Column("k_sigma", "float64", "percent", "as in the metrics", missing=True),
        Column("k_sigma_fixed_joints", "float64", "percent", "as in the metrics", missing=True),
        Column("deviation", "float64", "m", "as in the metrics", missing=True),
        Column("initial_deviation", "float64", "m", "as in the metrics"),
    ),
)

INITIAL = TableSchema(
    "initial",
    (
        _SET,
        Column("configurations", "int32", "", "configurations in the data set", minimum=1),
        Column("mean", "float64", "m", "mean over the data set of the end-effector's displacement under load", minimum=0),
        Column("mean_square", "float64", "m^2", "mean square of the same", minimum=0),
        Column("maximum", "float64", "m", "largest of the same", minimum=0),
    ),
)


def solvers(joints: int) -> TableSchema:
    """Estimates of both solvers at one length; one row for each strategy and data set, a row group holds one strategy."""
    pairs = [
        Column(f"{solver}_c{j}", "float64", "rad/(N m)", f"compliance of joint {j} by {solver.replace('_', ' ')}")
        for j in range(1, joints + 1)
        for solver in ("equation_11", "gauss_newton")
    ]
    return TableSchema("solvers", (Column("strategy", "string", "", "name of the strategy"), _SET, *pairs))


BOUNDS = TableSchema(
    "bounds",
    (
        Column("points", "string", "", "measuring points read, joined by +; a row group holds one set"),
        _LENGTH,
        Column(
            "rms_per_noise", "float64", "m/m", "Cramér-Rao bound of the RMS end-effector error per unit noise", missing=True
        ),
    ),
)


def _with_error(name: str, unit: str, meaning: str, over: str = "data sets and test configurations") -> list[Column]:
    return [
        Column(name, "float64", unit, meaning, missing=True),
        Column(f"{name}_std_error", "float64", unit, f"Monte Carlo standard error of {name} over {over}", missing=True),
    ]
