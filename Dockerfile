# planishd in a container. README.md, "The container", has the four lines from here to the first mesh.
#
#   docker build -t planish .
#   docker run -v "$PWD/credentials:/etc/planish/credentials:ro" -p 7741:7741 planish
#
# Arguments after the image's name go to planishd, variables PLANISHD_... are its settings, and
# /etc/planish/planishd.yaml is its configuration file (deploy/image.yaml). The container runs as uid 10001, needs no
# capabilities, and writes only to the volume /var/lib/planish, so it works with --read-only --cap-drop=ALL
# --security-opt=no-new-privileges. The image contains the command too: docker exec NAME planish health
FROM debian:bookworm-slim AS build
WORKDIR /src
# Packages first: they change less often than the code, so their layer stays in the cache.
COPY deploy/install-packages.sh deploy/
RUN deploy/install-packages.sh build runtime
COPY . .
RUN deploy/build.sh && cmake --install build/default --prefix /out --strip \
 && deploy/image-root.sh /out /root-of-image

FROM scratch
ARG VERSION=0.1.0
ARG REVISION=unknown
ARG CREATED=1970-01-01T00:00:00Z
LABEL org.opencontainers.image.title="planish" \
      org.opencontainers.image.description="Angle Based Flattening as a gRPC service" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}" \
      org.opencontainers.image.created="${CREATED}" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.documentation="file:///usr/share/doc/planish/README.md" \
      org.opencontainers.image.base.name="scratch"
COPY --from=build /root-of-image/ /
COPY LICENSE README.md /usr/share/doc/planish/
COPY deploy/image.yaml /etc/planish/planishd.yaml
ENV PLANISHD_CONFIG=/etc/planish/planishd.yaml
# A number, so that Kubernetes can check that it is not root.
USER 10001:10001
VOLUME /var/lib/planish
# The ports of calls and of metrics.
EXPOSE 7741 9741
# The health check uses the metrics port, which needs neither certificates nor tokens.
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s --retries=3 CMD ["planish", "health"]
ENTRYPOINT ["planishd"]
