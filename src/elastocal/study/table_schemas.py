"""Every table that the study keeps, column by column: name, type, unit, meaning. Written down here and nowhere else."""

from elastocal.io.storage import Column, TableSchema
from elastocal.mechanics.components import COMPONENTS, WRENCH


def _table(name: str, *columns: Column) -> TableSchema:
    return TableSchema(name, columns)


def _real(name: str, unit: str, meaning: str, missing: bool = False, minimum: float | None = None) -> Column:
    return Column(name, "float64", unit, meaning, missing, minimum)


def _whole(name: str, meaning: str, minimum: int) -> Column:
    return Column(name, "int32", "", meaning, minimum=minimum)


def _of_group(name: str, meaning: str) -> Column:
    """A word that is the same in a whole row group."""
    return Column(name, "string", "", meaning)


def _text(name: str, meaning: str) -> Column:
    """A word of its own in each row."""
    return Column(name, "text", "", meaning)


_SET = _whole("data_set", "number of the data set, from 0", 0)
_CONFIGURATION = _whole("configuration", "number of the configuration in its data set, from 0", 0)
_LENGTH = _whole("length", "data set length ds: how many configurations, from the first, were used", 1)
_ON_TESTS = "mean square end-effector error on test configurations"
_ERROR = _real("mean_square", "m^2", _ON_TESTS, missing=True)
_SCORES = (
    _real("k_sigma", "percent", "as in the metrics", missing=True),
    _real("k_sigma_fixed_joints", "percent", "as in the metrics", missing=True),
    _real("deviation", "m", "as in the metrics", missing=True),
)


def experiments(joints: int) -> TableSchema:
    """Configurations and wrenches; one row for each loaded configuration."""
    angles = [_real(f"q{j}", "rad", f"angle of joint {j}") for j in range(1, joints + 1)]
    wrench = [_real(name, unit, f"{meaning}, at the end-effector") for name, unit, meaning in WRENCH]
    return _table("experiments", _SET, _CONFIGURATION, *angles, *wrench)


DEFLECTIONS = _table(
    "deflections",
    _of_group("point", "measuring point; a row group holds one"),
    _SET,
    _CONFIGURATION,
    *(_real(name, unit, f"{meaning}, loaded against unloaded") for name, unit, meaning in COMPONENTS),
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
    return _table("design", _SET, _LENGTH, *covariances, condition)


def identified(joints: int) -> TableSchema:
    """What a strategy identified; one row for each data set and length."""
    compliances = [
        _real(f"c{j}", "rad/(N m)", f"identified compliance of joint {j}", missing=True) for j in range(1, joints + 1)
    ]
    return _table("identified", _SET, _LENGTH, *compliances)


def metrics(joints: int) -> TableSchema:
    """Equations 12-15, averaged over the data sets; one row for each length."""
    of_stiffness = "the averaged stiffness of joint"
    quantities = [
        *((f"compliance_{j}", "rad/(N m)", f"inverse of {of_stiffness} {j} (equation 12)") for j in range(1, joints + 1)),
        *((f"delta_k_{j}", "percent", f"relative error of {of_stiffness} {j} (equation 13)") for j in range(1, joints + 1)),
        ("k_sigma", "percent", "sum of delta_k over all joints (equation 14)"),
        ("k_sigma_fixed_joints", "percent", "sum of delta_k over the joints fixed in the last stage (interpretation R10)"),
        ("deviation", "m", "mean end-effector error of the averaged model on test configurations (equation 15)"),
        ("initial_deviation", "m", "mean deflection of the end-effector on the test configurations"),
    ]
    return _table(
        "metrics",
        _LENGTH,
        *(column for quantity in quantities for column in _with_error(*quantity)),
        _real("nonpositive_share", "", "share of data sets with a compliance that is not positive"),
        _real("relative_spread", "", "largest standard deviation over mean of an identified compliance", missing=True),
        Column("trustworthy", "bool", "", "whether the mean of 1/c exists in practice: none <= 0 and relative spread <= 0.25"),
    )


def _scores(joints: int) -> list[Column]:
    """Scores of the averaged model, without errors."""
    of_joint = "as in the metrics, of joint"
    return [
        *(_real(f"compliance_{j}", "rad/(N m)", f"{of_joint} {j}", missing=True) for j in range(1, joints + 1)),
        *_SCORES,
    ]


def repeated(joints: int) -> TableSchema:
    """Scores of further studies of the same size; one row for each study, strategy and length."""
    study = _whole("study", "number of the study, from 1; that of the tables is number 0", 1)
    strategy = _of_group("strategy", "name of the strategy")
    other = "by the mean of the compliances where the metrics have that of the stiffnesses"
    everything = "data sets, configurations and coordinates"
    more = (
        _real("k_sigma_mean_compliance", "percent", f"sum of delta_k over all joints, {other}", missing=True),
        _real("k_sigma_fixed_joints_mean_compliance", "percent", f"the same of the fixed joints, {other}", missing=True),
        _real("deviation_mean_compliance", "m", f"deviation {other}", missing=True),
        _real("deviation_signed", "m", f"position error with its sign, mean over {everything}", missing=True),
        _real("mean_square", "m^2", "mean square end-effector error of single data sets", missing=True),
    )
    return _table("repeated", study, strategy, _LENGTH, *_scores(joints), *more)


def expected(joints: int) -> TableSchema:
    """Expectations of the scores in closed form; one row for each length."""
    return _table("expected", _LENGTH, *_scores(joints))


BUDGET = _table(
    "budget",
    _of_group("points", "set of measuring points; a row group holds one"),
    _SET,
    _LENGTH,
    _ERROR,
    _real("bound", "m^2", "Cramér-Rao bound of the same", missing=True),
)

FEW = _table(
    "few",
    _real("nominal_error", "", "standard deviation of the logarithm of nominal over true compliances"),
    _of_group("strategy", "name of the strategy; a row group holds one"),
    _SET,
    _LENGTH,
    _ERROR,
)

KINDS = _table(
    "kinds",
    _of_group("kind", "what is measured; a row group holds one"),
    _whole("scalars", "scalar measurements of one configuration", 1),
    _SET,
    _LENGTH,
    _ERROR,
)

LADDER = _table(
    "ladder",
    _real("noise", "m, rad", "standard deviation of the measurements"),
    _LENGTH,
    _SET,
    _whole("link_springs", "number of link springs in the model", 0),
    _whole("added_link", "link whose spring came last, from 1; 0 where there is none", 0),
    Column("chosen", "bool", "", "whether cross-validation stops here"),
    _real("mean_square", "m^2", _ON_TESTS),
)

DESIGNS = _table(
    "designs",
    _text("joint_range", "of candidates and validation configurations: full_turn or limits"),
    _text("design", "criterion by which the configurations are chosen, random, or the bound of all designs"),
    _whole("configurations", "configurations of the design", 1),
    _real("rms", "m", "Cramér-Rao bound of the RMS end-effector error"),
    _real("low", "m", "5 % of random designs"),
    _real("high", "m", "95 % of random designs"),
)

SIMULATED_DESIGNS = _table(
    "simulated_designs",
    _text("load", "kind of load: random directions, or one direction in every configuration"),
    _text("design", "criterion by which the configurations are chosen, or random"),
    _whole("configurations", "configurations of the design", 1),
    _text("unobservable", "joints that the loads do not move, from 1, with commas between them"),
    _real("rms", "m", "RMS end-effector error over simulated data sets on test configurations"),
    _real("std_error", "m", "Monte Carlo standard error of the same"),
    _real("there", "m", "RMS end-effector error at the test pose"),
)

STIFFNESS = _table(
    "stiffness",
    _real("force", "N", "magnitude of the load"),
    _real("softest", "N/m", "least translational stiffness, median over test configurations"),
    _real("first_order", "percent", "distance of the first order from the exact kinematics over the displacement"),
    _real("loaded", "percent", "distance of the exact kinematics from the equilibrium of the loaded arm"),
    _real("by_k_c", "percent", "distance of equation 6 from equation 8 over the displacement"),
    _real("bias", "percent", "largest relative bias of a compliance by equation 11 from arms in equilibrium"),
    _real("k_sigma", "percent", "sum over joints of the relative bias of the stiffness"),
    Column("offset_rank", "int32", "", "joints that one data set identifies without the offset of the force"),
    Column("rank", "int32", "", "the same with the offset"),
)

STARTS = _table(
    "starts",
    _real("start", "rad/(N m)", "where Gauss-Newton starts each joint"),
    _real("difference", "", "largest relative difference of a compliance from that of the first start"),
    _real("unsettled", "", "share of data sets whose steps do not settle"),
)

OBSERVABILITY = _table(
    "observability",
    _SET,
    *(_real(f"O{number}", "", f"observability index O{number}") for number in range(1, 6)),
    _real("bound", "m^2", "Cramér-Rao bound of the mean square end-effector error"),
    _real("mean_square", "m^2", _ON_TESTS),
)

GEOMETRY = _table(
    "geometry",
    _text("estimator", "what is identified from which poses"),
    _real("noise", "m", "RMS error of the loaded position by noise"),
    _real("leak", "m", "RMS error of the loaded position by what the estimator leaves out"),
    _real("compliance_noise", "percent", "relative standard deviation of the compliances, RMS over joints"),
    _real("compliance_leak", "percent", "relative leak of geometry into the compliances, RMS over joints"),
    _real("zero_noise", "rad", "standard deviation of the joint zeros, RMS over joints"),
    _real("zero_leak", "rad", "error of the joint zeros by what is left out, RMS over joints"),
)

WEIGHTING = _table(
    "weighting",
    _real("orientation_ratio", "rad/m", "noise of orientations over that of positions"),
    _real("per_metre", "m/m", "growth of the noise of positions with the tracker's range"),
    _real("equal", "m", "RMS error by equal weights"),
    _real("weighted", "m", "RMS error by the weights of the noise"),
)

USES = _table(
    "uses",
    _of_group("strategy", "name of the strategy; a row group holds one"),
    _SET,
    _real("mean", "m", "mean end-effector error on test configurations"),
    _real("mean_square", "m^2", "mean square of the same"),
    _real("p95", "m", "95th percentile of the same"),
    _real("pooled_p95", "m", "95th percentile over test configurations and data sets, the same in every row"),
    _real("pooled_p95_influence", "m", "influence of the data set on the pooled percentile"),
    _real("iso_9283", "m", "largest error at the five poses of ISO 9283", missing=True),
    _real("path_mean_square", "m^2", "mean square error along the milling path", missing=True),
    _real("path_max", "m", "largest error along the milling path", missing=True),
)

PLACES = _table(
    "places",
    _whole("joints", "joints that move the target", 1),
    _real("along", "m", "way from the base along the chain"),
    _text("side", "of the link, the flange, or a bar on the flange"),
    _SET,
    _real("bound", "m^2", "Cramér-Rao bound with the target beside the end-effector"),
    _real("bound_end_effector", "m^2", "the same of the end-effector in twice as many configurations"),
    _real("turned", "", "share of configurations in which a tracker sees a reflector turned to it"),
    _real("fixed", "", "the same of a reflector that stays as it is"),
)

TUBES = _table(
    "tubes",
    _real("diameter", "m", "outer diameter of the tubes"),
    _SET,
    _real("mean", "m", "mean over the data set of the end-effector's displacement under load"),
    _real("mean_square", "m^2", "mean square of the same"),
    _real("maximum", "m", "largest of the same"),
    _real("left", "m^2", "mean square end-effector error on test configurations, by joint springs alone"),
)


def accuracy(joints: int) -> TableSchema:
    """What one data set gives, as the mean over data sets; one row for each evaluated length."""
    quantities = [
        ("mean", "m", "mean over test configurations of the end-effector position error"),
        ("rms", "m", "root mean square over test configurations and data sets"),
        ("p95", "m", "95th percentile over test configurations"),
        ("max", "m", "largest over test configurations"),
    ]
    columns = [
        column for quantity in quantities for column in _with_error(*quantity, over="data sets, for these test configurations")
    ]
    relative = "root mean square relative error of the compliance of joint"
    for j in range(1, joints + 1):
        columns += _with_error(f"relative_error_{j}", "percent", f"{relative} {j}")
    return _table("accuracy", _LENGTH, *columns)


_REPLICATE = _whole("replicate", "number of the bootstrap replicate, from 1", 1)

WEIGHTS = _table(
    "weights",
    _of_group("members", "what counts: data sets or test configurations; a row group holds one"),
    _whole("number", "number of the data set or test configuration, from 0", 0),
    _REPLICATE,
    _whole("count", "how often it counts in the replicate", 0),
)

REPLICATES = _table(
    "replicates",
    _REPLICATE,
    _LENGTH,
    *_SCORES,
    _real("initial_deviation", "m", "as in the metrics"),
)

INITIAL = _table(
    "initial",
    _SET,
    _whole("configurations", "configurations in the data set", 1),
    _real("mean", "m", "mean over the data set of the end-effector's displacement under load", minimum=0),
    _real("mean_square", "m^2", "mean square of the same", minimum=0),
    _real("maximum", "m", "largest of the same", minimum=0),
)


def solvers(joints: int) -> TableSchema:
    """Estimates of both solvers at one length; one row for each strategy and data set, a row group holds one strategy."""
    pairs = [
        _real(f"{solver}_c{j}", "rad/(N m)", f"compliance of joint {j} by {solver.replace('_', ' ')}")
        for j in range(1, joints + 1)
        for solver in ("equation_11", "gauss_newton")
    ]
    return _table("solvers", _of_group("strategy", "name of the strategy"), _SET, *pairs)


BOUNDS = _table(
    "bounds",
    _of_group("points", "measuring points read, joined by +; a row group holds one set"),
    _LENGTH,
    _real("rms_per_noise", "m/m", "Cramér-Rao bound of the RMS end-effector error per unit noise", missing=True),
)


def _with_error(name: str, unit: str, meaning: str, over: str = "data sets and test configurations") -> list[Column]:
    return [
        _real(name, unit, meaning, missing=True),
        _real(f"{name}_std_error", unit, f"Monte Carlo standard error of {name} over {over}", missing=True),
    ]
