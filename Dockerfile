# Builds an image (1 GB, half of it the viewer) that watches /site/site.toml:
#     docker build -t modalwatch .
#     docker run --network host --device /dev/ttyUSB0 -v /srv/bridge:/site modalwatch
# The base is python:3.11-slim of one day, for all processors: take a newer one now and then for its security updates,
#     docker buildx imagetools inspect python:3.11-slim
ARG BASE=python:3.11-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7
FROM ${BASE} AS build
WORKDIR /source
COPY requirements.lock .
RUN python -m venv /opt/modalwatch \
    && /opt/modalwatch/bin/pip install --no-cache-dir --no-compile --no-deps --require-hashes -r requirements.lock
COPY . .
RUN /opt/modalwatch/bin/pip install --no-cache-dir --no-compile --no-deps .

FROM ${BASE}
RUN useradd --system --uid 10001 --groups dialout --home-dir /site modalwatch \
    && mkdir /site && chown modalwatch /site
COPY --from=build /opt/modalwatch /opt/modalwatch
ENV PATH=/opt/modalwatch/bin:$PATH OPENBLAS_NUM_THREADS=1 PYTHONUNBUFFERED=1
USER modalwatch
WORKDIR /site
VOLUME /site
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["modalwatch", "health", "/site/site.toml"]
ENTRYPOINT ["modalwatch"]
CMD ["run", "/site/site.toml"]
