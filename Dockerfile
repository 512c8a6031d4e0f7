ARG DEBIAN=trixie
FROM debian:${DEBIAN}-slim

WORKDIR /fabric_fenicsx
# The packages come in layers of their own, made from the few files that scripts/setup reads, so that a
# change of the code rebuilds the image in seconds.
COPY scripts/setup scripts/
RUN scripts/setup system && rm -rf /var/lib/apt/lists/* /var/cache/apt/*
COPY pyproject.toml ./
COPY fabric_fenicsx/__init__.py fabric_fenicsx/
RUN scripts/setup && rm -rf /root/.cache

COPY . .
ENV PATH=/fabric_fenicsx/.venv/bin:$PATH
CMD ["make", "help"]
