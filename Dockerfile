# The pinned environment and the pipeline: `docker build -t elastocal .`; see docs/cluster.md. The base by the digest of its list
# of all platforms; `docker buildx imagetools inspect python:3.11-slim` says that of the newest.
FROM python:3.11-slim@sha256:90744cff8f32887f075c47d747a173ff333e9e98801667af93c357fa9f5e28ff
WORKDIR /opt/elastocal
# Pins first, so that an edit of the sources leaves this layer as it is.
COPY requirements-install.lock requirements-cluster.lock ./
RUN python -m pip install --no-cache-dir --require-hashes -r requirements-install.lock \
    && uv pip install --system --no-cache --no-deps --require-hashes -r requirements-cluster.lock
COPY pyproject.toml README.md LICENSE CITATION.cff paper.bib Snakefile config.yaml ./
COPY config config
COPY profiles profiles
COPY src src
COPY workflow workflow
RUN uv pip install --system --no-cache --no-deps --no-build-isolation -e .
# Snakemake asks for a home to keep a cache in and for a name, which a user of another number than root's does not have here.
ENV HOME=/tmp USER=elastocal
# Nobody's number, so that a folder that is mounted needs `--user`, and nothing runs as root without it.
USER 10001:10001
ENTRYPOINT ["snakemake"]
