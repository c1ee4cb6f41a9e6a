# Builds an image (1 GB, half of it the viewer) that watches /site/site.toml:
#     docker build -t modalwatch .
#     docker run --network host --device /dev/ttyUSB0 -v /srv/bridge:/site modalwatch
FROM python:3.11-slim AS build
WORKDIR /source
COPY . .
# the lock holds the tools of development too: as constraints, it gives what is installed its version, and no more
RUN python -m venv /opt/modalwatch \
    && /opt/modalwatch/bin/pip install --no-cache-dir --no-compile --constraint requirements.lock '.[fleet]'

FROM python:3.11-slim
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
