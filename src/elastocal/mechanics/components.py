"""Components of a displacement and of a wrench: the name, unit and meaning that all
tables and files use."""

COMPONENTS = (
    *((f"d{axis}", "m", f"displacement along base {axis}") for axis in "xyz"),
    *((f"r{axis}", "rad", f"rotation vector about base {axis}") for axis in "xyz"),
)
WRENCH = (
    *((f"f{axis}", "N", f"force along base {axis}") for axis in "xyz"),
    *((f"m{axis}", "N m", f"moment about base {axis}") for axis in "xyz"),
)
COMPONENT_NAMES = tuple(name for name, _, _ in COMPONENTS)
WRENCH_NAMES = tuple(name for name, _, _ in WRENCH)
