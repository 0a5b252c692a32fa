# SPDX-License-Identifier: Apache-2.0
# raysplats_view: the page goes into the library. host/view/server.cpp, which alone needs Boost.Beast, is left out without
# RAYSPLATS_VIEWER; host/view/server_absent.cpp then says so to whoever wants a server.
raysplats_embed_texts(raysplats_view ${PROJECT_SOURCE_DIR}/host/view/page page_sources view/page_sources.hpp *.html *.css *.js)
if(RAYSPLATS_VIEWER)
  find_package(Boost 1.74 REQUIRED)
  target_link_libraries(raysplats_view PRIVATE Boost::headers)
  set_source_files_properties(${PROJECT_SOURCE_DIR}/host/view/server_absent.cpp PROPERTIES HEADER_FILE_ONLY ON)
else()
  set_source_files_properties(${PROJECT_SOURCE_DIR}/host/view/server.cpp PROPERTIES HEADER_FILE_ONLY ON)
endif()
