# make paper: the paper's tables and figures from nothing, two campaigns.  make study: the rest of the study.  make test: the tests.
PYTHON ?= python3
BIN = .venv/bin
CORES ?= 2
# The pins have every dependency, so none is looked for; compiled once, since an environment may forbid programs to do it as they run.
INSTALL = $(BIN)/uv pip install -q --system-certs --compile-bytecode --python $(BIN)/python

.PHONY: paper cameras study proof audit test test-slow test-slurm fuzz soak mutants lint catalogue bench pictures site supply conda dist installed lock clean

paper: .venv/ready
	$(BIN)/snakemake -j$(CORES)

# Two robots without a laser tracker: a printed tool, and a camera with a board.
cameras: .venv/ready
	$(BIN)/snakemake -j$(CORES) cameras

# Further questions, repeated studies and designs, with the report of the study.
study: .venv/ready
	$(BIN)/snakemake -j$(CORES) study

# The blind benchmark as it is registered: docs/blind_registration.md.
proof: .venv/ready
	OMP_NUM_THREADS=1 $(BIN)/snakemake -j$(CORES) -k blind --config blind=registered seed=20261130

# Samples of every file worked out again, by pinocchio among others, which nothing else of a run needs.
audit: .venv/ready-for-audit
	$(BIN)/snakemake -j$(CORES) audit

# Of the slow tests none: blind benchmark, planted errors, closed loop, demonstration, tutorial, Slurm, wheel and site are in
# test-slow. CI adds those of one file, which the commit chooses: make test SLOW="one --commit c0ffee"
SLOW ?= none
test: .venv/ready-for-tests
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -n 2 --dist loadfile --no-loadscope-reorder --slow $(SLOW)

test-slow:
	$(MAKE) test SLOW="all -m slow"

# The profile for Slurm on a Slurm of this machine, which the tests start and stop; asks for root. It ends after ten minutes at the latest;
# the daemons end with the tests, however those end. The first failure ends it too, so that its cause is printed within this time.
test-slurm: .venv/ready-for-tests
	OMP_NUM_THREADS=1 ELASTOCAL_SLURM=1 timeout --kill-after=20 580 $(BIN)/python -m pytest -q -rs -x --slow all tests/workflow/test_slurm.py

# The tests of tests/fuzz with 90 times as many inputs, and others each time: 5 minutes.
fuzz: .venv/ready-for-tests
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q tests/fuzz --hypothesis-profile=long

# Forty kills at random moments, full disks, two runs at once.
soak: .venv/ready-for-tests
	OMP_NUM_THREADS=1 $(BIN)/python tests/faults/soak.py $(SOAK)

# How many small faults in the code the tests notice: a random sample, see tests/mutation/sample.py.
mutants: .venv/ready-for-tests
	rm -rf mutants
	OPENBLAS_NUM_THREADS=1 nice -n 19 $(BIN)/python tests/mutation/sample.py $(SAMPLE)

lint: .venv/ready-for-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/python workflow/lint.py

# After a new or changed effect: the list of all candidates that a test compares, and the table of sizes in docs/method.md.
catalogue: .venv/ready-for-tests
	PYTHONPATH=tests/helpers $(BIN)/python tests/helpers/catalogue_lists.py

# Lines of code and syntax nodes of each package.
sizes:
	@$(PYTHON) workflow/sizes.py

bench: .venv/ready-for-tests
	$(BIN)/python benchmarks/run.py

# Pictures of the README, from the figures of a finished study.
pictures: .venv/ready
	$(BIN)/snakemake -j$(CORES) pictures

# The documentation as a site, site/html/index.html: a browser reads it with and without a network. A warning is an error.
site: .venv/ready-for-tests
	$(BIN)/snakemake -j1 signatures
	$(BIN)/python docs/site/assemble.py site/source
	$(BIN)/sphinx-build -q -W --keep-going -j $(CORES) -b html -c docs/site -d site/cache site/source site/html

# Wheel and source archive of the version in src/elastocal/__init__.py.
dist: .venv/ready
	rm -rf dist
	$(BIN)/uv build -q --no-build-isolation --python $(BIN)/python --out-dir dist

# Two fresh environments with the lowest or the highest versions that pyproject.toml allows, by an interpreter:
# make installed RESOLUTION=highest INTERPRETER=3.13
# First the source archive with the base requirements, from arrays to corrected targets; then the wheel with all, the whole way
# without the checkout.
RESOLUTION ?= lowest-direct
INTERPRETER ?= $(PYTHON)
installed: dist
	rm -rf .installed
	$(BIN)/uv venv -q --python $(INTERPRETER) .installed/base
	$(BIN)/uv pip compile -q --system-certs --resolution $(RESOLUTION) --python .installed/base/bin/python pyproject.toml \
	    -o .installed/base.txt
	$(BIN)/uv pip install -q --system-certs --python .installed/base/bin/python -r .installed/base.txt
	$(BIN)/uv pip install -q --system-certs --no-deps --python .installed/base/bin/python dist/*.tar.gz
	OMP_NUM_THREADS=1 .installed/base/bin/python workflow/examples/five_lines.py
	$(BIN)/uv venv -q --python $(INTERPRETER) .installed/env
	$(BIN)/uv pip compile -q --system-certs --resolution $(RESOLUTION) --python .installed/env/bin/python pyproject.toml --extra proof \
	    -o .installed/versions.txt
	$(BIN)/uv pip install -q --system-certs --python .installed/env/bin/python -r .installed/versions.txt
	$(BIN)/uv pip install -q --no-deps --python .installed/env/bin/python dist/*.whl
	work="$$(mktemp -d)" && cd "$$work" && OMP_NUM_THREADS=1 "$(CURDIR)/.installed/env/bin/elastocal" demo && rm -r "$$work"

# The conda package of recipe/, built, installed in an empty environment and run there. Where conda-forge is not reached,
# make conda CHANNELS=stand-in has empty packages with the names and versions of what is installed here.
CHANNELS ?= conda-forge bioconda
conda: .venv/ready .venv-conda/ready
	OMP_NUM_THREADS=1 .venv-conda/bin/python workflow/conda_package.py --libraries $(BIN)/python $(CHANNELS:%=--channel %)

# What the environment consists of, as CycloneDX, and what is known to be vulnerable in it: asks the vulnerability service of PyPI.
supply: .venv/ready .venv-supply/ready
	.venv-supply/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible -o sbom.cdx.json $(BIN)/python
	.venv-supply/bin/pip-audit --progress-spinner off --skip-editable --path $$($(BIN)/python -c "import site; print(*site.getsitepackages())")

# New pins. The index is the caller's own; none is written into the lock files.
lock:
	uv pip compile --group install --universal --python-version 3.11 --generate-hashes --no-header -o requirements/install.lock
	uv pip compile pyproject.toml --extra build --extra proof --universal --python-version 3.11 --generate-hashes --no-header \
	    -o requirements/run.lock
	uv pip compile pyproject.toml --extra build --extra audit --universal --python-version 3.11 --generate-hashes --no-header \
	    -c requirements/run.lock -o requirements/audit.lock
	uv pip compile pyproject.toml --extra build --extra cluster --universal --python-version 3.11 --generate-hashes --no-header \
	    -c requirements/run.lock -o requirements/cluster.lock
	uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 --generate-hashes --no-header \
	    -c requirements/audit.lock -c requirements/cluster.lock -o requirements/test.lock
	uv pip compile --group supply --universal --python-version 3.11 --generate-hashes --no-header -o requirements/supply.lock
	uv pip compile --group conda --universal --python-version 3.11 --generate-hashes --no-header -o requirements/conda.lock

clean:
	rm -rf .venv .venv-supply .venv-conda .snakemake data/simulated results/[a-z]* reports/[a-z]* site sbom.cdx.json

# A file of its own: the interpreter in the environment is a link to an old one, which make would take for out of date for ever.
.venv/made: requirements/install.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "elastocal needs Python 3.11 or later, and this is Python %d.%d: make PYTHON=python3.11 paper" % sys.version_info[:2])'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -q --require-hashes -r requirements/install.lock
	touch $@

.venv/ready: requirements/run.lock pyproject.toml | .venv/made
	$(INSTALL) --no-deps --require-hashes -r requirements/run.lock
	$(INSTALL) --no-deps --no-build-isolation -e .
	$(BIN)/python -m compileall -q src
	touch $@

# What the audit needs besides.
.venv/ready-for-audit: requirements/audit.lock .venv/ready
	$(INSTALL) --no-deps --require-hashes -r requirements/audit.lock
	touch $@

# What a run on a cluster needs besides: docs/cluster.md.
.venv/ready-for-cluster: requirements/cluster.lock .venv/ready
	$(INSTALL) --no-deps --require-hashes -r requirements/cluster.lock
	touch $@

.venv/ready-for-tests: requirements/test.lock .venv/ready
	$(INSTALL) --no-deps --require-hashes -r requirements/test.lock
	touch $@

# Environments of their own for what builds a package, and for what looks at the environment from outside.
.venv-conda/ready: requirements/conda.lock | .venv/made
	$(PYTHON) -m venv .venv-conda
	$(BIN)/uv pip install -q --system-certs --python .venv-conda/bin/python --no-deps --require-hashes -r requirements/conda.lock
	touch $@

.venv-supply/ready: requirements/supply.lock | .venv/made
	$(PYTHON) -m venv .venv-supply
	$(BIN)/uv pip install -q --system-certs --python .venv-supply/bin/python --no-deps --require-hashes -r requirements/supply.lock
	touch $@
