# SPDX-License-Identifier: Apache-2.0
# The install target: program, static libraries, the library of pictures, public headers, configurations and the package that
# find_package(raysplats) reads. The modules of benchmarks and tests stay in the build
# folder.
include(CMakePackageConfigHelpers)

set(package_directory ${CMAKE_INSTALL_LIBDIR}/cmake/raysplats)

set(images_archive "")
if(RAYSPLATS_IMAGES_STATIC)
  set(images_archive raysplats_images)
else()
  install(TARGETS raysplats_images LIBRARY DESTINATION ${RAYSPLATS_MODULE_DIR} COMPONENT runtime)
endif()
if(RAYSPLATS_HAVE_MPI)
  install(TARGETS raysplats_mpi LIBRARY DESTINATION ${RAYSPLATS_MODULE_DIR} COMPONENT mpi)
  install(FILES scripts/cmake/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/raysplats-mpi COMPONENT mpi)
endif()
install(
  TARGETS raysplats
          raysplats_util
          raysplats_comm
          raysplats_scene
          raysplats_device
          raysplats_parallel
          raysplats_bvh
          raysplats_trace
          raysplats_light
          raysplats_io
          raysplats_run
          raysplats_render
          raysplats_eval
          raysplats_train
          ${images_archive}
  EXPORT raysplatsTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(TARGETS raysplats_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
install(DIRECTORY include/raysplats DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev FILES_MATCHING PATTERN "*.hpp")
install(DIRECTORY configs/ DESTINATION ${CMAKE_INSTALL_DATADIR}/raysplats/configs COMPONENT runtime
        FILES_MATCHING PATTERN "*.toml")
install(FILES LICENSE CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/raysplats COMPONENT runtime)
# Debian looks for this name.
install(FILES scripts/cmake/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/raysplats COMPONENT runtime)
install(FILES scripts/cmake/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/raysplats-dev COMPONENT dev)
include(RaysplatsManual)

install(EXPORT raysplatsTargets NAMESPACE raysplats:: DESTINATION ${package_directory} COMPONENT dev)
set(RAYSPLATS_USES_OPENCV ${OpenCV_FOUND})
if(NOT RAYSPLATS_IMAGES_STATIC)
  set(RAYSPLATS_USES_OPENCV FALSE)
endif()
configure_package_config_file(
  scripts/cmake/raysplatsConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/package/raysplatsConfig.cmake
  INSTALL_DESTINATION ${package_directory} NO_SET_AND_CHECK_MACRO)
# Before 1.0 a minor version may change the interface.
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/package/raysplatsConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/package/raysplatsConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/package/raysplatsConfigVersion.cmake
              scripts/cmake/RaysplatsOpenCV.cmake
        DESTINATION ${package_directory} COMPONENT dev)
include(RaysplatsPackage)
