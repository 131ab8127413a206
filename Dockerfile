# SPDX-License-Identifier: BSD-3-Clause
# holba in a container:  docker build -t holba .
#   docker run --rm -v "$PWD:/work" holba reconstruct --image_path images --output_path output
# Built without Ceres, so that the image's program is not under the GPL (README.md, "Licence").
FROM debian:bookworm-slim AS build
WORKDIR /src
COPY cmake/setup.sh cmake/setup.sh
RUN bash -c 'source cmake/setup.sh && holba_install_packages "${holba_build_packages[@]}" dpkg-dev'
COPY . .
RUN cmake -S . -B /build -G Ninja -DHOLBA_BUILD_TESTS=OFF -DHOLBA_WITH_CERES=OFF && cmake --build /build
RUN cd /build && cpack && rm -rf _CPack_Packages && ls *.deb

FROM debian:bookworm-slim
COPY --from=build /build/holba_*.deb /tmp/
RUN apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends /tmp/holba_*.deb \
    && rm -rf /var/lib/apt/lists/* /tmp/holba_*.deb
WORKDIR /work
ENTRYPOINT ["holba"]
CMD ["help"]
