# The demo in a container: a noisy table in a random pose, its four planes, and all there is to look at.
#   docker build -t symrefine .
#   docker run --rm -v "$PWD/out:/symrefine/out" symrefine                               # make demo, into out/demo
#   docker run --rm -v "$PWD:/data" symrefine .venv/bin/symrefine detect /data/part.ply
FROM python:3.11-slim-bookworm

# make, and what open3d is linked with (libusb comes as a wheel).
RUN apt-get update \
    && apt-get install --yes --no-install-recommends make libegl1 libgl1 libidn2-0 libudev1 libx11-6 \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /symrefine
# The packages first: they are 2 GB, and change less often than the code.
COPY requirements.lock ./
RUN python -m venv .venv && .venv/bin/python -m pip install --no-cache-dir -r requirements.lock
COPY pyproject.toml hatch_build.py Makefile README.md LICENSE ./
COPY symrefine ./symrefine
RUN make setup
COPY experiments ./experiments
CMD ["make", "demo"]
