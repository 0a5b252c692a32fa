# SPDX-License-Identifier: Apache-2.0
# raysplats_images: formats of pictures and networks (host/images). As a rule a library that raysplats_io loads when
# the first picture is opened, found along the run path of the program; with RAYSPLATS_IMAGES_STATIC linked as any other.
# With RAYSPLATS_IMAGES_GIVEN there is none: the program that links the library defines raysplats_images_codec()
# (io/image/image_codec.hpp).

# The headers that declare the interface, for io/image/images_interface.hpp.
set(headers "")
foreach(header host/io/image/image_codec.hpp include/raysplats/image.hpp include/raysplats/error.hpp)
  file(SHA256 ${PROJECT_SOURCE_DIR}/${header} digest)
  string(APPEND headers ${digest})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
endforeach()
set_source_files_properties(
  ${PROJECT_SOURCE_DIR}/host/io/image/image_codec.cpp ${PROJECT_SOURCE_DIR}/host/images/oiio_codec.cpp
  PROPERTIES COMPILE_DEFINITIONS RAYSPLATS_IMAGES_HEADERS="${headers}")

if(RAYSPLATS_IMAGES_GIVEN)
  target_compile_definitions(raysplats_io PRIVATE RAYSPLATS_IMAGES_STATIC)
  return()
endif()
file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/host/images/*.cpp)
if(RAYSPLATS_IMAGES_STATIC)
  add_library(raysplats_images STATIC ${sources})
  set_target_properties(raysplats_images PROPERTIES EXPORT_NAME images)
  target_link_libraries(raysplats_io PUBLIC raysplats_images)
  target_compile_definitions(raysplats_io PRIVATE RAYSPLATS_IMAGES_STATIC)
else()
  add_library(raysplats_images MODULE ${sources})
  set_target_properties(raysplats_images PROPERTIES OUTPUT_NAME raysplats-images)
  # Whoever links the libraries runs with the module.
  add_dependencies(raysplats_io raysplats_images)
  target_link_libraries(raysplats_io PRIVATE ${CMAKE_DL_LIBS})
  target_link_options(raysplats_io
                      INTERFACE "$<INSTALL_INTERFACE:LINKER:-rpath,$<INSTALL_PREFIX>/${RAYSPLATS_MODULE_DIR}>")
endif()
target_include_directories(raysplats_images PRIVATE ${PROJECT_SOURCE_DIR}/include)
target_compile_definitions(raysplats_images PRIVATE RAYSPLATS_VERSION="${PROJECT_VERSION}")
target_link_libraries(raysplats_images PRIVATE fmt::fmt OpenImageIO::OpenImageIO OpenEXR::OpenEXR
                                               OpenEXR::OpenEXRCore)
if(OpenCV_FOUND)
  target_link_libraries(raysplats_images PRIVATE ${OpenCV_LIBS})
  target_include_directories(raysplats_images SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  target_compile_definitions(raysplats_images PRIVATE RAYSPLATS_HAVE_OPENCV)
endif()
raysplats_compile_options(raysplats_images)
