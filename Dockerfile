# lhdmap in a container: docker build -t lhdmap . ; docker run --rm -v "$PWD:/data" lhdmap build-map /data/drive.mcap
# It holds the core: maps, places, routes, reports. Simulation needs system libraries beside the extra `sim`.
FROM python:3.11-slim-bookworm AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1
RUN python -m venv /opt/lhdmap
COPY requirements /src/requirements
RUN /opt/lhdmap/bin/pip install --require-hashes --only-binary :all: -r /src/requirements/core.txt \
    && pip install --require-hashes --only-binary :all: -r /src/requirements/build.txt
COPY . /src
RUN pip wheel --no-deps --no-build-isolation --wheel-dir /wheels /src \
    && /opt/lhdmap/bin/pip install --no-deps --no-index /wheels/*.whl
# The kernels are compiled once, here: a map is built of a log that ships. The cache hangs on the path of the sources,
# so both stages have them in one place, and on the processor: another kind compiles anew.
ENV NUMBA_CACHE_DIR=/opt/numba
RUN /opt/lhdmap/bin/python -m lhdmap build-map /src/datasets/mit_csail.clf.bz2 -o /tmp/map --one-process --quiet \
    && rm -rf /tmp/map

FROM python:3.11-slim-bookworm
COPY --from=build /opt/lhdmap /opt/lhdmap
COPY --from=build --chown=10001:10001 /opt/numba /opt/numba
ENV PATH=/opt/lhdmap/bin:$PATH NUMBA_CACHE_DIR=/opt/numba MPLCONFIGDIR=/tmp/matplotlib
USER 10001:10001
WORKDIR /data
ENTRYPOINT ["lhdmap"]
CMD ["--help"]
