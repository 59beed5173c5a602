# An image with `fledge` and no compiler: docker build -t fledge . && docker run fledge run nadir_spin
FROM debian:13 AS made
COPY . /fledge
RUN /fledge/fledge package --out /packages
FROM debian:13
COPY --from=made /packages /packages
RUN apt-get update && apt-get install -y /packages/*.deb && rm -rf /packages /var/lib/apt/lists/*
ENTRYPOINT ["fledge"]
