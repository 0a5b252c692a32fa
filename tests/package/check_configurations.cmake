# SPDX-License-Identifier: Apache-2.0
# Run by cmake -P from the test: configures SOURCE below WORK for several configurations, and looks whether the program of
# each finds the libraries that it loads by itself where the same configuration puts them. Nothing is built.

set(build ${WORK}/configurations)
file(REMOVE_RECURSE ${build})
execute_process(
  COMMAND ${CMAKE_COMMAND} -G "Ninja Multi-Config" -S ${SOURCE} -B ${build} -DCMAKE_CXX_COMPILER=${COMPILER}
          -DRAYSPLATS_BUILD_TESTS=OFF -DRAYSPLATS_INSTALL=OFF
  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "configure failed with ${status}:\n${output}")
endif()

foreach(configuration Debug Release)
  set(rules ${build}/CMakeFiles/impl-${configuration}.ninja)
  file(STRINGS ${rules} library REGEX "^build [^ ]*libraysplats-images[.]so:")
  string(REGEX REPLACE "^build ([^ ]*)/libraysplats-images[.]so:.*" "\\1" folder "${library}")
  file(STRINGS ${rules} program REGEX "^build [^ ]*/raysplats:")
  file(STRINGS ${rules} paths REGEX "rpath,[^ ]*")
  string(REGEX MATCHALL "rpath,[^: ]*" paths "${paths}")
  list(REMOVE_DUPLICATES paths)
  if(NOT program MATCHES "bin/${configuration}/" OR NOT paths STREQUAL "rpath,${build}/${folder}")
    message(FATAL_ERROR "${configuration}: the library is in ${build}/${folder}, and is looked for along ${paths}")
  endif()
endforeach()
