# SPDX-License-Identifier: Apache-2.0
# Manual pages and completions, which the program writes of itself: not where it cannot be run.
if(NOT CMAKE_CROSSCOMPILING AND RAYSPLATS_BUILD_PROGRAM)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/generated)
  add_custom_command(
    OUTPUT ${generated}/done
    COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:raysplats_cli> -DFOLDER=${generated}
            -P ${PROJECT_SOURCE_DIR}/scripts/cmake/write_manual.cmake
    DEPENDS raysplats_cli ${PROJECT_SOURCE_DIR}/scripts/cmake/write_manual.cmake
    VERBATIM)
  add_custom_target(raysplats_manual ALL DEPENDS ${generated}/done)
  install(DIRECTORY ${generated}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT runtime)
  install(FILES ${generated}/raysplats.bash RENAME raysplats
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT runtime)
  install(FILES ${generated}/_raysplats
          DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT runtime)
  install(FILES ${generated}/raysplats.fish
          DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT runtime)
endif()
