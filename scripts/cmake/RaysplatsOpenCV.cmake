# SPDX-License-Identifier: Apache-2.0
# Finds OpenCV's core and dnn and sets OpenCV_FOUND and OpenCV_LIBS. Debian ships OpenCVConfig.cmake only in
# libopencv-dev, which brings every other module (VTK, Java) along; libopencv-dnn-dev alone is enough here, so its
# header and libraries are looked up when there is no configuration file.

find_package(OpenCV QUIET COMPONENTS core dnn)
if(NOT OpenCV_FOUND)
  find_path(RAYSPLATS_OPENCV_INCLUDE_DIR opencv2/dnn.hpp PATH_SUFFIXES opencv4)
  find_library(RAYSPLATS_OPENCV_CORE opencv_core)
  find_library(RAYSPLATS_OPENCV_DNN opencv_dnn)
  mark_as_advanced(RAYSPLATS_OPENCV_INCLUDE_DIR RAYSPLATS_OPENCV_CORE RAYSPLATS_OPENCV_DNN)
  if(RAYSPLATS_OPENCV_INCLUDE_DIR AND RAYSPLATS_OPENCV_CORE AND RAYSPLATS_OPENCV_DNN)
    if(NOT TARGET opencv_dnn)
      add_library(opencv_core UNKNOWN IMPORTED)
      set_target_properties(opencv_core PROPERTIES IMPORTED_LOCATION ${RAYSPLATS_OPENCV_CORE}
                                                   INTERFACE_INCLUDE_DIRECTORIES ${RAYSPLATS_OPENCV_INCLUDE_DIR})
      add_library(opencv_dnn UNKNOWN IMPORTED)
      set_target_properties(opencv_dnn PROPERTIES IMPORTED_LOCATION ${RAYSPLATS_OPENCV_DNN}
                                                  INTERFACE_LINK_LIBRARIES opencv_core)
    endif()
    set(OpenCV_FOUND TRUE)
    set(OpenCV_LIBS opencv_core opencv_dnn)
    set(OpenCV_INCLUDE_DIRS ${RAYSPLATS_OPENCV_INCLUDE_DIR})
  endif()
endif()
