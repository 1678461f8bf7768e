# One image for all nodes: `docker build -t zenoh-vision .`, then `docker run zenoh-vision camera`.
ARG BASE=debian:bookworm-slim

# Dependencies: rebuilt only when they change.
FROM ${BASE} AS dependencies
RUN apt-get update \
    && apt-get install -y --no-install-recommends binutils python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /build
COPY requirements requirements
RUN python3 -m venv /opt/pip \
    && /opt/pip/bin/pip install --no-cache-dir --require-hashes -r requirements/build.txt \
    && python3 -m venv --without-pip /opt/venv
# Every file that is installed is one whose hash is known.
RUN /opt/pip/bin/pip --python /opt/venv/bin/python install --no-cache-dir \
        --require-hashes -r requirements/shm.txt \
    && find /opt/venv \( -type d -name tests -o -type d -name test -o -name conftest.py -o -name test_cases.py -o -name test_utils.py \) \
        -prune -exec rm -rf {} + \
    # Symbols for debuggers, the second of two bindings, and what only compilers and type checkers
    # read: over 50 MB. The package of this project is copied later and keeps its stub.
    && cd /opt/venv/lib/python3*/site-packages && rm -rf zstandard/_cffi*.so numpy/f2py pygments/lexers/__pycache__ \
    && find . \( -name '*.pyi' -o -name '*.pyx' -o -name '*.pxd' -o -name '*.h' -o -name '*.a' \) -delete \
    && find zstandard lz4 cryptography zenoh pydantic_core aiohttp msgpack -name '*.so' \
        -exec strip --strip-unneeded {} +

# The project itself, in its own folder, so that a change of the code copies nothing else.
FROM dependencies AS project
COPY pyproject.toml README.md LICENSE ./
COPY .ci/weights_hook.py .ci/weights_hook.py
COPY configs configs
COPY services services
COPY common common
# --build-arg ZV_WEIGHTS= leaves out the weights of the edge detector `learned`.
ARG ZV_WEIGHTS=yes
RUN ZV_WEIGHTS="$ZV_WEIGHTS" /opt/pip/bin/pip install --no-cache-dir --no-deps --no-build-isolation \
        --target /opt/zenoh-vision . \
    && sed -i '1s|.*|#!/opt/venv/bin/python|' /opt/zenoh-vision/bin/zv

FROM ${BASE}
ARG VERSION=0.1.0
ARG REVISION=unknown
ARG ZV_WEIGHTS=yes
LABEL org.opencontainers.image.title="zenoh-vision" \
      org.opencontainers.image.description="Cameras and vision on the network without ROS, over Eclipse Zenoh" \
      org.opencontainers.image.licenses="Apache-2.0 AND MIT${ZV_WEIGHTS:+ AND LicenseRef-BSDS500-weights}" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 \
    && rm -rf /var/lib/apt/lists/* /var/cache/apt /var/log/apt /var/log/dpkg.log /usr/lib/python3*/test \
    && useradd --uid 10001 --groups video --no-create-home --shell /usr/sbin/nologin zv \
    # A volume that is mounted here belongs to the user at first.
    && install -d -o zv -g zv -m 700 /events
COPY --from=dependencies /opt/venv /opt/venv
ENV PATH=/opt/zenoh-vision/bin:/opt/venv/bin:$PATH \
    PYTHONPATH=/opt/zenoh-vision \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    ZV_HEALTH_FILE=/tmp/zv-health \
    ZV_SUPERVISED=1
USER zv
WORKDIR /tmp
# Every service writes its health to that file. The check only reads it, without interpreter and
# network. (A time in the future does not count as healthy either, since clocks are set back.)
HEALTHCHECK --interval=3s --timeout=3s --start-period=30s --retries=2 CMD \
    if ! find "$ZV_HEALTH_FILE" -newermt '5 seconds ago' ! -newermt '5 seconds' | grep -q .; \
    then echo "$ZV_HEALTH_FILE has not been written for 5 s"; exit 1; \
    fi; grep -q '^ok' "$ZV_HEALTH_FILE" || { cat "$ZV_HEALTH_FILE"; exit 1; }
ENTRYPOINT ["zv"]
CMD ["--help"]
# Last, since it changes most often.
COPY --from=project /opt/zenoh-vision /opt/zenoh-vision
