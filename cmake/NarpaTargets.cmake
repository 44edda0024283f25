# How every target of narpa is made: language level, warnings, sanitizers, install rules.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

option(NARPA_UNITY "Compile several sources of a target at once: a faster whole build, slower single changes" OFF)
if(NOT DEFINED CMAKE_UNITY_BUILD_BATCH_SIZE)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 20)
endif()
set(NARPA_SANITIZE "" CACHE STRING "Sanitizers for every target: address,undefined or thread")
set(NARPA_SANITIZED 0)
if(NARPA_SANITIZE)
  set(NARPA_SANITIZED 1)
endif()
# UBSan's pointer checks are off: they cost a quarter of the compile time, and AddressSanitizer reports the resulting
# errors.
set(narpa_unchecked -fno-sanitize=null,alignment,object-size,pointer-overflow,vptr)
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  set(narpa_unwanted_warnings -Wno-missing-braces -Wno-bitwise-instead-of-logical)  # loops over lanes have no branches
elseif(NARPA_UNITY)
  set(narpa_unwanted_warnings -Wno-subobject-linkage)
endif()
find_program(NARPA_CCACHE ccache)
if(NARPA_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # Paths below the project's folder count as relative: clones in other folders find what this one has compiled.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${NARPA_CCACHE})
endif()

function(narpa_compile_options target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${NARPA_UNITY})
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor
                                           -Woverloaded-virtual $<$<BOOL:${NARPA_WERROR}>:-Werror>
                                           ${narpa_unwanted_warnings})
  target_compile_definitions(${target} PRIVATE NARPA_SANITIZED=${NARPA_SANITIZED})
  # The same results on every machine with the same instruction set: the compiler may not contract to fused
  # multiply-add. No code reads errno after sqrt.
  target_compile_options(${target} PRIVATE -ffp-contract=off -fno-math-errno)
  if(NARPA_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${NARPA_SANITIZE} -fno-omit-frame-pointer
                                             -fno-sanitize-recover=undefined ${narpa_unchecked})
    target_link_options(${target} PUBLIC -fsanitize=${NARPA_SANITIZE})
  endif()
  if(NARPA_SANITIZE STREQUAL "thread")
    target_include_directories(${target} BEFORE PRIVATE ${PROJECT_SOURCE_DIR}/tests/threads)  # tbb/parallel_for.h
  endif()
endfunction()

# narpa_export(NAME) - installs the library narpa::NAME in the package's component of its top-level folder. NAME is a
# folder's path with "_" for "/".
function(narpa_export name)
  set_target_properties(narpa_${name} PROPERTIES EXPORT_NAME ${name})
  string(REGEX REPLACE "_.*" "" component ${name})
  install(TARGETS narpa_${name} EXPORT narpa-${component} COMPONENT dev)
  set_property(GLOBAL APPEND PROPERTY NARPA_COMPONENTS ${component})
endfunction()

# narpa_link(TARGET NAME=LIBRARY...) - links libraries that only the target's sources include. LIBRARY, often an imported
# target, is linked here and -lNAME in the installed package: its users need the library but not its CMake package, of
# which that of Imath prints dozens of lines. "NAME" alone: both are the same.
function(narpa_link target)
  string(REGEX REPLACE "^narpa_([a-z]+).*" "\\1" component ${target})
  foreach(entry ${ARGN})
    string(REGEX REPLACE "=.*" "" name ${entry})
    string(REGEX REPLACE "^[^=]*=" "" library ${entry})
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:${library}> $<INSTALL_INTERFACE:${name}>)
    set_property(GLOBAL APPEND PROPERTY NARPA_${component}_LIBRARIES ${name})
  endforeach()
endfunction()

# narpa_library(FOLDER [SIMD|LIGHT] [INTERNAL] LINKS LIBRARIES...) - one library of all sources below FOLDER except main.cpp.
# LINKS names the libraries whose headers it may include; tests/layout checks every #include against these lists. SIMD:
# loops over the lanes of a ray batch are to be vectorised. LIGHT: it computes little, and compiles in three quarters of
# the time with less optimization. INTERNAL: it is not installed.
function(narpa_library folder)
  cmake_parse_arguments(arg "SIMD;LIGHT;INTERNAL" "" "LINKS" ${ARGN})
  string(REPLACE "/" "_" name ${folder})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.cpp)
  list(FILTER sources EXCLUDE REGEX "/main\\.cpp$")
  if(NOT sources)  # headers alone
    add_library(narpa_${name} INTERFACE)
    set(scope INTERFACE)
  else()
    add_library(narpa_${name} STATIC ${sources})
    set_target_properties(narpa_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    set(scope PUBLIC)
  endif()
  add_library(narpa::${name} ALIAS narpa_${name})
  if(NOT arg_INTERNAL)
    narpa_export(${name})
  endif()
  target_include_directories(narpa_${name} ${scope} $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                                    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  foreach(library ${arg_LINKS})
    string(REPLACE "/" "_" linked ${library})
    target_link_libraries(narpa_${name} ${scope} narpa::${linked})
  endforeach()
  list(JOIN arg_LINKS " " links)
  set_property(GLOBAL APPEND PROPERTY NARPA_LINKS "${folder}: ${links}")
  if(NOT sources)
    return()
  endif()
  narpa_compile_options(narpa_${name})
  if(NARPA_SANITIZE AND folder MATCHES "^(base|protocols|renderer|estimator)")
    target_compile_options(narpa_${name} PRIVATE -O1)  # folders that compute; others compile in half the time without
  endif()
  if(arg_LIGHT)
    target_compile_options(narpa_${name} PRIVATE $<$<NOT:$<CONFIG:Debug>>:-O1>)
  endif()
  if(arg_SIMD)
    # GCC otherwise leaves most of these loops scalar. Neither option changes a result: no floating-point exception flag
    # is read, so both sides of a choice may be computed.
    target_compile_options(narpa_${name} PRIVATE $<$<NOT:$<CONFIG:Debug>>:-O3> -fno-trapping-math)
    if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
      set_target_properties(narpa_${name} PROPERTIES UNITY_BUILD OFF)  # inlining across sources changes the vector code
    endif()
  endif()
endfunction()

# OpenCV 4.6's headers warn in C++20.
function(narpa_use_opencv target)
  target_include_directories(${target} SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  list(TRANSFORM ARGN PREPEND opencv_)
  narpa_link(${target} ${ARGN})
endfunction()

# Debian's package of Ceres names the static library, which adds 4 MB to each program.
macro(narpa_find_ceres)
  find_package(Ceres REQUIRED)
  find_library(CERES_SHARED_LIBRARY ${CMAKE_SHARED_LIBRARY_PREFIX}ceres${CMAKE_SHARED_LIBRARY_SUFFIX})
  if(CERES_SHARED_LIBRARY)
    set_target_properties(Ceres::ceres PROPERTIES IMPORTED_LOCATION ${CERES_SHARED_LIBRARY}
                                                  IMPORTED_LOCATION_RELEASE ${CERES_SHARED_LIBRARY})
  endif()
endmacro()

function(narpa_executable name)
  add_executable(${name} ${ARGN})
  foreach(used narpa-mesh-reader narpa-dem-reader narpa-image-codecs)  # programs that read scenes start or load them
    if(TARGET ${used} AND NOT name STREQUAL ${used})
      add_dependencies(${name} ${used})
    endif()
  endforeach()
  narpa_compile_options(${name})
endfunction()

function(narpa_install_package)
  set(dir ${CMAKE_INSTALL_LIBDIR}/cmake/narpa)
  get_property(components GLOBAL PROPERTY NARPA_COMPONENTS)
  list(REMOVE_DUPLICATES components)
  get_property(all_links GLOBAL PROPERTY NARPA_LINKS)
  set(narpa_components "set(narpa_components ${components})\n")
  foreach(component ${components})
    install(EXPORT narpa-${component} NAMESPACE narpa:: DESTINATION ${dir} FILE narpa-${component}.cmake
            COMPONENT dev)
    set(uses "")
    foreach(entry ${all_links})
      if(entry MATCHES "^${component}[/:]")
        string(REGEX REPLACE "^[^:]*:" "" links "${entry}")
        string(REGEX MATCHALL "[a-z]+(/[a-z]+)?" links "${links}")
        list(TRANSFORM links REPLACE "/.*" "")
        list(APPEND uses ${links})
      endif()
    endforeach()
    list(REMOVE_DUPLICATES uses)
    list(REMOVE_ITEM uses ${component})
    get_property(libraries GLOBAL PROPERTY NARPA_${component}_LIBRARIES)
    list(REMOVE_DUPLICATES libraries)
    string(APPEND narpa_components "set(narpa_${component}_uses ${uses})\n"
                                   "set(narpa_${component}_libraries ${libraries})\n")
  endforeach()
  string(REPLACE ";" " " narpa_components "${narpa_components}")
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/narpaConfig.cmake.in ${CMAKE_BINARY_DIR}/narpaConfig.cmake
                                INSTALL_DESTINATION ${dir})
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/narpaConfigVersion.cmake COMPATIBILITY SameMajorVersion)
  install(FILES ${CMAKE_BINARY_DIR}/narpaConfig.cmake ${CMAKE_BINARY_DIR}/narpaConfigVersion.cmake DESTINATION ${dir}
          COMPONENT dev)
  include(${PROJECT_SOURCE_DIR}/cmake/PublicHeaders.cmake)
  list(JOIN NARPA_PUBLIC_HEADERS "$<SEMICOLON>" headers)
  install(CODE "execute_process(COMMAND \${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR}
    \"-DDESTINATION=\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}\" \"-DHEADERS=${headers}\"
    -P ${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake COMMAND_ERROR_IS_FATAL ANY)" COMPONENT dev)
endfunction()
