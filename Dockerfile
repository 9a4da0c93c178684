# Dashpot in Debian 12, built:
#   docker build -t dashpot . && docker run --rm dashpot ./run demo && docker run --rm dashpot ./run test
FROM debian:12
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates ccache git \
  && rm -rf /var/lib/apt/lists/*
WORKDIR /dashpot
COPY . .
RUN ./run build && rm -rf /var/lib/apt/lists/*
CMD ["./run", "demo"]
