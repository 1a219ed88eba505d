"""Components of a displacement and of a wrench, by the names that all tables and files
use."""

COMPONENT_NAMES = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH_NAMES = ("fx", "fy", "fz", "mx", "my", "mz")
