# SPDX-License-Identifier: Apache-2.0
# raysplats_module(NAME DEPENDS ...) makes the static library raysplats_NAME from all *.cpp below host/NAME.

set(RAYSPLATS_WARNINGS -Wall -Wextra -Wpedantic)
if(RAYSPLATS_WERROR)
  list(APPEND RAYSPLATS_WARNINGS -Werror)
endif()

# Processors with an instruction for a product and a sum (ARM, x86 where it is told of FMA) round the two at once, where the
# compiler finds them: a distance would then depend on the place that computes it, and files on the processor.
include(CheckCXXSourceCompiles)
check_cxx_source_compiles("#if defined(__x86_64__) && !defined(__FMA__)\n#error\n#endif\nint main() {}" RAYSPLATS_HAVE_FMA)

# How our own targets are compiled. They alone see what is private (host, cl): whoever links the library has include/raysplats.
function(raysplats_compile_options target)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/host ${PROJECT_SOURCE_DIR}/cl)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_compile_options(${target} PRIVATE ${RAYSPLATS_WARNINGS})
  if(RAYSPLATS_HAVE_FMA AND CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    target_compile_options(${target} PRIVATE -ffp-contract=off)
  endif()
  if(RAYSPLATS_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${RAYSPLATS_SANITIZE} -fno-omit-frame-pointer
                                             -fno-sanitize-recover=undefined,float-cast-overflow)
    target_link_options(${target} PUBLIC -fsanitize=${RAYSPLATS_SANITIZE})
  endif()
endfunction()

function(raysplats_module name)
  cmake_parse_arguments(ARG "" "" "DEPENDS" ${ARGN})
  if(RAYSPLATS_BUNDLE)
    raysplats_bundle(ARG_DEPENDS)
  endif()
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/host/${name}/*.cpp)
  set(target raysplats_${name})
  add_library(${target} STATIC ${sources})
  set_target_properties(${target} PROPERTIES LINKER_LANGUAGE CXX EXPORT_NAME ${name}
                                             POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
                                              $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_definitions(${target} PRIVATE RAYSPLATS_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS})
  raysplats_compile_options(${target})
endfunction()
