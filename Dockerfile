# planishd in a container.
#
#   docker build -t planish .
#   docker run --rm -p 7741:7741 planish
#   planish unwrap --server=localhost:7741 mesh.obj -o flat.obj
#
# Arguments after the image's name go to planishd: docker run --rm -p 7741:7741 planish --workers=8
# Jobs that outlive the container: docker run -v planish:/var/lib/planish -p 7741:7741 planish --data-dir=/var/lib/planish
# The image holds the command as well: docker exec NAME planish jobs list --server=127.0.0.1:7741

FROM debian:bookworm-slim AS build
WORKDIR /src
# Packages first: they change less often than the code, so the layer is kept.
COPY deploy/install-packages.sh deploy/
RUN deploy/install-packages.sh build
COPY . .
RUN deploy/build.sh && cmake --install build/default --prefix /out --strip

FROM debian:bookworm-slim
ARG VERSION=0.1.0
LABEL org.opencontainers.image.title="planish" \
      org.opencontainers.image.description="Angle Based Flattening as a gRPC service" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.base.name="debian:bookworm-slim"
COPY deploy/install-packages.sh /tmp/
RUN /tmp/install-packages.sh runtime \
 && apt-get clean && rm -rf /tmp/install-packages.sh /var/lib/apt/lists/* \
 && useradd --uid 10001 --user-group --no-create-home --shell /usr/sbin/nologin planish \
 && install -d -o planish -g planish -m 700 /var/lib/planish
COPY LICENSE /usr/share/doc/planish/
COPY --from=build /out/bin/ /usr/local/bin/
# A number, so that Kubernetes can tell that it is not root.
USER 10001:10001
EXPOSE 7741
# A gRPC call to the server, not just an open port.
HEALTHCHECK --interval=10s --timeout=5s --start-period=5s --retries=3 \
  CMD ["planish", "version", "--server=127.0.0.1:7741"]
ENTRYPOINT ["planishd", "--listen=0.0.0.0:7741"]
