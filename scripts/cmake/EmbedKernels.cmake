# SPDX-License-Identifier: Apache-2.0
# raysplats_embed_kernels(TARGET DIR) compiles every file below DIR into TARGET as the table kernel_sources().

function(raysplats_embed_kernels target directory)
  file(GLOB_RECURSE kernels CONFIGURE_DEPENDS ${directory}/*.cl ${directory}/*.h)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/generated/kernel_sources.cpp)
  set(generator ${PROJECT_SOURCE_DIR}/scripts/cmake/GenerateKernelSources.cmake)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${CMAKE_COMMAND} -DDIRECTORY=${directory} -DOUTPUT=${generated} -P ${generator}
    DEPENDS ${kernels} ${generator}
    COMMENT "Embedding OpenCL kernels"
    VERBATIM)
  target_sources(${target} PRIVATE ${generated})
endfunction()
