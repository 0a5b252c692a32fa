# SPDX-License-Identifier: Apache-2.0
# raysplats_embed_texts(TARGET DIR FUNCTION HEADER PATTERN...) compiles every file below DIR that a pattern matches into
# TARGET, as the table by path that the header declares as FUNCTION().

function(raysplats_embed_texts target directory function header)
  list(TRANSFORM ARGN PREPEND ${directory}/ OUTPUT_VARIABLE patterns)
  file(GLOB_RECURSE texts CONFIGURE_DEPENDS ${patterns})
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/generated/${function}.cpp)
  set(generator ${PROJECT_SOURCE_DIR}/scripts/cmake/GenerateTextTable.cmake)
  list(JOIN ARGN " " spaced)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${CMAKE_COMMAND} -DDIRECTORY=${directory} -DOUTPUT=${generated} -DFUNCTION=${function} -DHEADER=${header}
            "-DPATTERNS=${spaced}" -P ${generator}
    DEPENDS ${texts} ${generator}
    COMMENT "Embedding ${directory}"
    VERBATIM)
  target_sources(${target} PRIVATE ${generated})
endfunction()
