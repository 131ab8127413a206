# SPDX-License-Identifier: BSD-3-Clause
# Packages by CPack: `cpack --config build/CPackConfig.cmake` makes two Debian packages, holba (the program, its manual
# pages and completion) and libholba-dev (the library). Dependencies of the first are what dpkg-shlibdeps finds.
# A package of a build with Debian's Ceres is under the GPL as a whole (README.md, "Licence"):
# configure with -DHOLBA_WITH_CERES=OFF for one that is not; its name says which it is.
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_SOURCE_DIR}/CITATION.cff
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/holba COMPONENT program)
# Debian's name for the licence of a package.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/holba RENAME copyright
        COMPONENT program)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME holba)
set(CPACK_PACKAGE_VENDOR "holba")
set(CPACK_PACKAGE_CONTACT "The holba authors <holba@example.org>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
if(HOLBA_WITH_CERES)
  set(CPACK_DEBIAN_PACKAGE_RELEASE 1+gpl)
else()
  set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
endif()
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME holba)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
# What is looked for at run time only.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "colmap, bash-completion")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "Photographs to cameras, points, lines and the structures that tie them together,\n adjusted all at once; reads and writes COLMAP's models and databases.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libholba-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Headers, static libraries and CMake files of holba (find_package(holba)).")
set(depends libeigen3-dev libfmt-dev libspdlog-dev nlohmann-json3-dev libsqlite3-dev libbz2-dev libmetis-dev libopenblas-dev)
if(HOLBA_WITH_FRONTEND)
  list(APPEND depends libopencv-features2d-dev libopencv-imgproc-dev libhdf5-dev zlib1g-dev libjpeg-dev libpng-dev libtiff-dev)
endif()
if(HOLBA_WITH_CERES)
  list(APPEND depends libceres-dev)
endif()
list(JOIN depends ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
include(CPack)
