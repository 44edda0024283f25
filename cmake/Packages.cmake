# Debian packages, by `cpack` in a build folder that scripts/package configures: narpa, narpa-dev, narpa-doc and
# python3-narpa.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME narpa)
set(CPACK_PACKAGE_CONTACT "the developers of narpa <narpa@example.org>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL narpa dev doc)
if(NARPA_HAS_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # image codecs too, which programs load when an image is read
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_NARPA_PACKAGE_NAME narpa)
set(CPACK_DEBIAN_NARPA_DESCRIPTION "Hardware-in-the-loop camera and LiDAR emulator
Emulates a spacecraft's camera and LiDAR, in the loop with a real navigation
computer: poses in on CAN, camera frames out on V4L2, LiDAR packets out on UDP.
Estimates poses from its own frames, and rehearses dockings and landings.")
set(CPACK_DEBIAN_NARPA_PACKAGE_DEPENDS python3)
set(CPACK_DEBIAN_NARPA_PACKAGE_RECOMMENDS "python3-matplotlib, narpa-doc")  # charts of reports
set(CPACK_DEBIAN_NARPA_PACKAGE_SUGGESTS narpa-dev)

set(CPACK_DEBIAN_DEV_PACKAGE_NAME narpa-dev)
set(CPACK_DEBIAN_DEV_DESCRIPTION "Libraries of the camera and LiDAR emulator narpa
Headers, static libraries, the CMake package, and the program of `narpa bench`.")
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "narpa (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "libembree-dev, libtbb-dev, libopencv-dev, libeigen3-dev, libceres-dev, nlohmann-json3-dev, liberfa-dev, libfmt-dev, libtomlplusplus-dev, libopenexr-dev, libpcap-dev, libusb-1.0-0-dev, libaravis-dev, zlib1g-dev")

set(CPACK_DEBIAN_DOC_PACKAGE_NAME narpa-doc)
set(CPACK_DEBIAN_DOC_DESCRIPTION "Documents of the camera and LiDAR emulator narpa
Tasks, formats, models and measured accuracy, with pictures.")
set(CPACK_DEBIAN_DOC_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-narpa)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "Camera and LiDAR emulator narpa within Python
Renders, scans and estimates to and from numpy arrays, and runs the emulator in
lockstep.")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3, python3-numpy, narpa (= ${PROJECT_VERSION})")

set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_LIST_DIR}/debian/prerm)

foreach(entry narpa=narpa dev=narpa-dev doc=narpa-doc python=python3-narpa)
  string(REPLACE "=" ";" entry ${entry})
  list(GET entry 0 component)
  list(GET entry 1 package)
  install(FILES LICENSE DESTINATION share/doc/${package} COMPONENT ${component} RENAME copyright)
endforeach()
include(CPack)
