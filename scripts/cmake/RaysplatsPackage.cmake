# SPDX-License-Identifier: Apache-2.0
# cpack: Debian packages of the program, of what MPI needs and of the library's headers, and one archive that runs from anywhere.
# Debian wants an address; who hands packages out gives one that is read. RFC 2606: no mail goes to .invalid.
set(RAYSPLATS_MAINTAINER "RaySplats-CL contributors <contributors@raysplats-cl.invalid>"
    CACHE STRING "Name and address in Debian packages")
# Debian's own change log: that of the packages, which have no changes of their own.
find_program(RAYSPLATS_GZIP gzip)
mark_as_advanced(RAYSPLATS_GZIP)
if(RAYSPLATS_GZIP)
  string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC) # SOURCE_DATE_EPOCH is heeded
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/package/changelog
       "raysplats (${PROJECT_VERSION}) unstable; urgency=medium\n\n  * CHANGELOG.md says what is new.\n\n"
       " -- ${RAYSPLATS_MAINTAINER}  ${now}\n")
  execute_process(COMMAND ${RAYSPLATS_GZIP} -9nf ${CMAKE_CURRENT_BINARY_DIR}/package/changelog)
  set(packages runtime:raysplats dev:raysplats-dev)
  if(RAYSPLATS_HAVE_MPI)
    list(APPEND packages mpi:raysplats-mpi)
  endif()
  foreach(package IN LISTS packages)
    string(REPLACE ":" ";" package ${package})
    list(GET package 0 component)
    list(GET package 1 folder)
    install(FILES ${CMAKE_CURRENT_BINARY_DIR}/package/changelog.gz
            DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${folder} COMPONENT ${component})
  endforeach()
endif()
set(CPACK_PACKAGE_NAME raysplats)
set(CPACK_PACKAGE_VENDOR "RaySplats-CL")
set(CPACK_PACKAGE_CONTACT ${RAYSPLATS_MAINTAINER})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "train and ray trace 3D Gaussians on any OpenCL device")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_GENERATOR DEB TGZ)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL runtime dev)
if(RAYSPLATS_HAVE_MPI)
  list(APPEND CPACK_COMPONENTS_ALL mpi)
endif()
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
                                                WORLD_EXECUTE)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${RAYSPLATS_MAINTAINER})
set(CPACK_DEBIAN_PACKAGE_HOMEPAGE "")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME raysplats)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "pocl-opencl-icd | opencl-icd")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "raysplats-mpi, ffmpeg, colmap")
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION
    "Photos go in, a standard 3D Gaussian Splatting model comes out,
on GPUs of every vendor and on CPUs.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME raysplats-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "raysplats (= ${PROJECT_VERSION}), pkg-config, ocl-icd-opencl-dev, opencl-clhpp-headers, libglm-dev, libfmt-dev, libspdlog-dev, \
nlohmann-json3-dev, libxxhash-dev, libtinyobjloader-dev, libtinygltf-dev, libtomlplusplus-dev, zlib1g-dev, libzstd-dev, libwebp-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Headers, static libraries and the CMake package of RaySplats-CL.")
# Of its own, because who has one computer needs no MPI.
set(CPACK_DEBIAN_MPI_PACKAGE_NAME raysplats-mpi)
set(CPACK_DEBIAN_MPI_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_MPI_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS "raysplats (= ${PROJECT_VERSION})")
set(CPACK_COMPONENT_MPI_DESCRIPTION "What lets the processes of mpirun share the work of RaySplats-CL.")
include(CPack)
