# SPDX-License-Identifier: Apache-2.0
# Run by cmake -P from the test: installs BUILD below WORK, then configures, builds and runs SOURCE and EXAMPLES
# against it.

function(run what)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${what} failed with ${status}:\n${output}")
  endif()
  message(STATUS "${what}: done")
  set(output "${output}" PARENT_SCOPE)
endfunction()

set(prefix ${WORK}/prefix)
file(REMOVE_RECURSE ${prefix} ${WORK}/consumer ${WORK}/examples)
run("install" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix} --config ${CONFIG})

foreach(file bin/raysplats include/raysplats/device.hpp share/raysplats/configs)
  if(NOT EXISTS ${prefix}/${file})
    message(FATAL_ERROR "${file} was not installed")
  endif()
endforeach()
file(GLOB_RECURSE strays ${prefix}/*reference* ${prefix}/*test*)
if(strays)
  message(FATAL_ERROR "Files of the tests were installed: ${strays}")
endif()

# Packages are made of components: together they have all that is installed.
include(${BUILD}/CPackConfig.cmake)
file(REMOVE_RECURSE ${WORK}/parts)
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  run("install ${component}" ${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/parts --config ${CONFIG}
      --component ${component})
endforeach()
file(GLOB_RECURSE installed RELATIVE ${prefix} ${prefix}/*)
file(GLOB_RECURSE packed RELATIVE ${WORK}/parts ${WORK}/parts/*)
list(REMOVE_ITEM installed ${packed})
if(installed)
  message(FATAL_ERROR "No package has ${installed}")
endif()

# What the program loads by itself lies in a folder of its own, where it finds it: photos are written by such a library.
file(GLOB stray ${prefix}/lib/*.so ${prefix}/lib/*/*.so)
if(stray)
  message(FATAL_ERROR "${stray} is where libraries for everybody are")
endif()
if(EXISTS ${prefix}/bin/raysplats)
  run("installed program" ${prefix}/bin/raysplats generate ${WORK}/photos --size 8 --train-views 1 --test-views 1)
endif()

set(flags "")
if(SANITIZE)
  set(flags -fsanitize=${SANITIZE})
endif()
set(choices -G ${GENERATOR} -DCMAKE_BUILD_TYPE=${CONFIG} -DCMAKE_PREFIX_PATH=${prefix}
            -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -DCMAKE_CXX_FLAGS=${flags})
run("configure" ${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/consumer ${choices} -DEXPECTED_VERSION=${VERSION})
run("build" ${CMAKE_COMMAND} --build ${WORK}/consumer --config ${CONFIG})
run("run" ${CMAKE_COMMAND} -E chdir ${WORK}/consumer ${WORK}/consumer/consumer)
message(STATUS "${output}")

# What only the program and pictures need must not reach whoever links the library.
if(NOT SANITIZE)
  file(STRINGS ${WORK}/consumer/consumer heavy REGEX "lib(OpenImageIO|OpenEXR|opencv_[a-z]+|benchmark)[-._0-9]*\\.so")
  if(heavy)
    message(FATAL_ERROR "A program that links the library needs ${heavy}")
  endif()
endif()

# The examples check the numbers they print.
run("configure examples" ${CMAKE_COMMAND} -S ${EXAMPLES} -B ${WORK}/examples ${choices})
run("build examples" ${CMAKE_COMMAND} --build ${WORK}/examples --config ${CONFIG})
file(GLOB examples RELATIVE ${EXAMPLES} ${EXAMPLES}/*.cpp)
foreach(example IN LISTS examples)
  cmake_path(REMOVE_EXTENSION example)
  run("example ${example}" ${CMAKE_COMMAND} -E chdir ${WORK}/examples ${WORK}/examples/${example})
  message(STATUS "${output}")
endforeach()
