# SPDX-License-Identifier: Apache-2.0
# raysplats_bundle: what fmt, spdlog, xxHash, tinyobjloader, tinygltf and toml++ define in shared libraries, built from
# their headers instead, so that a wheel needs none of them, and the archives of zstd and WebP. The library's own sources are
# compiled exactly as without.

set(raysplats_bundled fmt::fmt spdlog::spdlog PkgConfig::XXHASH tinyobjloader::tinyobjloader TinyGLTF::TinyGLTF
                      tomlplusplus::tomlplusplus)
file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/bundle/*.cpp)
add_library(raysplats_bundle STATIC ${sources})
set_target_properties(raysplats_bundle PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden)
target_compile_features(raysplats_bundle PUBLIC cxx_std_20)
# The header of toml++ as the library reads it.
target_include_directories(raysplats_bundle PRIVATE ${PROJECT_SOURCE_DIR}/host ${PROJECT_SOURCE_DIR}/include)
foreach(target IN LISTS raysplats_bundled)
  foreach(property INCLUDE_DIRECTORIES COMPILE_DEFINITIONS COMPILE_OPTIONS)
    get_target_property(${property} ${target} INTERFACE_${property})
    if(NOT ${property})
      set(${property} "")
    endif()
  endforeach()
  target_include_directories(raysplats_bundle SYSTEM PUBLIC ${INCLUDE_DIRECTORIES})
  target_compile_definitions(raysplats_bundle PUBLIC ${COMPILE_DEFINITIONS})
  target_compile_options(raysplats_bundle PUBLIC ${COMPILE_OPTIONS})
endforeach()
# tinygltf is given the JSON alone: it opens no files and decodes no pictures.
target_compile_definitions(raysplats_bundle PUBLIC TINYGLTF_NO_STB_IMAGE TINYGLTF_NO_STB_IMAGE_WRITE)
find_library(RAYSPLATS_ZSTD_ARCHIVE libzstd.a REQUIRED)
find_library(RAYSPLATS_WEBP_ARCHIVE libwebp.a REQUIRED)
mark_as_advanced(RAYSPLATS_ZSTD_ARCHIVE RAYSPLATS_WEBP_ARCHIVE)
target_link_libraries(raysplats_bundle PUBLIC ${RAYSPLATS_ZSTD_ARCHIVE} ${RAYSPLATS_WEBP_ARCHIVE})
# A part of libwebp before its version 1.3.
find_library(RAYSPLATS_SHARPYUV_ARCHIVE libsharpyuv.a)
mark_as_advanced(RAYSPLATS_SHARPYUV_ARCHIVE)
if(RAYSPLATS_SHARPYUV_ARCHIVE)
  target_link_libraries(raysplats_bundle PUBLIC ${RAYSPLATS_SHARPYUV_ARCHIVE})
endif()

# Replaces the names of the bundled libraries in a list of targets.
function(raysplats_bundle list)
  set(targets ${${list}})
  list(REMOVE_ITEM targets ${raysplats_bundled} PkgConfig::ZSTD PkgConfig::WEBP)
  if(NOT "${targets}" STREQUAL "${${list}}")
    list(APPEND targets raysplats_bundle)
  endif()
  set(${list} ${targets} PARENT_SCOPE)
endfunction()
