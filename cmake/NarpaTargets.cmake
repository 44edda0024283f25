# How every target of narpa is made: language level, warnings, sanitizers, install rules.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE RelWithDebInfo)
endif()

set(NARPA_SANITIZE "" CACHE STRING "Sanitizers for every target: address,undefined or thread")
find_program(NARPA_CCACHE ccache)
if(NARPA_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${NARPA_CCACHE})
endif()

function(narpa_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor
                                           -Woverloaded-virtual $<$<BOOL:${NARPA_WERROR}>:-Werror>)
  # Same bytes on every machine with the same instruction set: no fused multiply-add behind our back. Nobody reads errno
  # after sqrt.
  target_compile_options(${target} PRIVATE -ffp-contract=off -fno-math-errno)
  if(NARPA_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${NARPA_SANITIZE} -fno-omit-frame-pointer
                                             -fno-sanitize-recover=undefined)
    target_link_options(${target} PUBLIC -fsanitize=${NARPA_SANITIZE})
  endif()
endfunction()

# narpa_library(NAME FOLDER SOURCES... ) - one library per folder; its links are the architecture.
function(narpa_library name)
  add_library(narpa_${name} STATIC ${ARGN})
  add_library(narpa::${name} ALIAS narpa_${name})
  set_target_properties(narpa_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(narpa_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                                  $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/narpa>)
  narpa_compile_options(narpa_${name})
  install(TARGETS narpa_${name} EXPORT narpaTargets)
  install(DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/narpa/${name}
          FILES_MATCHING PATTERN "*.h")
endfunction()

function(narpa_executable name)
  add_executable(${name} ${ARGN})
  narpa_compile_options(${name})
endfunction()

function(narpa_install_package)
  set(dir ${CMAKE_INSTALL_LIBDIR}/cmake/narpa)
  install(EXPORT narpaTargets NAMESPACE narpa:: DESTINATION ${dir})
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/narpaConfig.cmake.in ${CMAKE_BINARY_DIR}/narpaConfig.cmake
                                INSTALL_DESTINATION ${dir})
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/narpaConfigVersion.cmake COMPATIBILITY SameMajorVersion)
  install(FILES ${CMAKE_BINARY_DIR}/narpaConfig.cmake ${CMAKE_BINARY_DIR}/narpaConfigVersion.cmake DESTINATION ${dir})
endfunction()
