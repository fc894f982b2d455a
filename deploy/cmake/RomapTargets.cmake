# Compiler settings, the libraries of the distribution, and functions that create one target per folder.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

find_program(ROMAP_CCACHE ccache)
if(ROMAP_CCACHE)
  # The sloppiness lets ccache trust precompiled headers. The base directory makes paths relative, so that two clones of
  # one commit share their results.
  set(CMAKE_CXX_COMPILER_LAUNCHER
      env CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime
      CCACHE_BASEDIR=${CMAKE_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${ROMAP_CCACHE})
endif()

add_compile_options(-Wall -Wextra -pthread)
if(ROMAP_WERROR)
  add_compile_options(-Werror)
endif()
if(ROMAP_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)  # what libFuzzer observes
endif()
if(ROMAP_SANITIZER)
  add_compile_options(-fsanitize=${ROMAP_SANITIZER} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${ROMAP_SANITIZER})
  if(ROMAP_SANITIZER MATCHES undefined)
    # Checked at every access, these two would double the code and the time. AddressSanitizer finds null accesses, too.
    add_compile_options(-fno-sanitize=null,alignment)
  endif()
  # Under AddressSanitizer, Eigen would use its own allocator, but the installed libraries (Ceres) do not, and our code
  # frees their matrices.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

# Hardening: checks of the library's preconditions, of copies and of the stack; no writable tables of addresses. GCC of
# the distribution makes position-independent programs by default. Sanitizers check more, and do not go with all of it.
add_compile_definitions($<$<COMPILE_LANGUAGE:CXX>:_GLIBCXX_ASSERTIONS>)
if(NOT ROMAP_SANITIZER)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fstack-protector-strong> $<$<COMPILE_LANGUAGE:CXX>:-fstack-clash-protection>)
  if(NOT CMAKE_BUILD_TYPE STREQUAL Debug)  # it needs optimization
    add_compile_definitions($<$<COMPILE_LANGUAGE:CXX>:_FORTIFY_SOURCE=2>)
  endif()
  add_link_options(LINKER:-z,relro,-z,now,-z,noexecstack)
endif()

find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Protobuf REQUIRED)
find_package(gRPC CONFIG REQUIRED)
find_package(absl CONFIG REQUIRED)
find_package(Eigen3 CONFIG REQUIRED)
find_package(Ceres CONFIG REQUIRED)
find_package(OpenCV CONFIG REQUIRED COMPONENTS core imgproc imgcodecs features2d calib3d ximgproc)
find_package(spdlog CONFIG REQUIRED)
find_package(fmt CONFIG REQUIRED)
find_package(yaml-cpp CONFIG REQUIRED)
find_package(nlohmann_json CONFIG REQUIRED)
find_package(TBB CONFIG REQUIRED)
find_package(draco CONFIG REQUIRED)
find_package(JPEG REQUIRED)
find_package(PNG REQUIRED)
find_package(nanoflann CONFIG REQUIRED)
find_package(meshoptimizer CONFIG REQUIRED)
find_package(TinyGLTF CONFIG REQUIRED)
find_package(tinyobjloader CONFIG REQUIRED)
find_package(utf8cpp CONFIG REQUIRED)
find_package(SQLiteCpp CONFIG REQUIRED)
find_package(OpenSSL REQUIRED)
find_package(prometheus-cpp CONFIG REQUIRED COMPONENTS core)
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy)
pkg_check_modules(STB REQUIRED IMPORTED_TARGET stb)
pkg_check_modules(SODIUM REQUIRED IMPORTED_TARGET libsodium)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(LIBEVENT REQUIRED IMPORTED_TARGET libevent_core libevent_extra libevent_openssl libevent_pthreads)

# OpenCV's headers cause warnings under C++20, so they are included as system headers.
add_library(romap_opencv INTERFACE)
target_include_directories(romap_opencv SYSTEM INTERFACE ${OpenCV_INCLUDE_DIRS})
target_link_libraries(romap_opencv INTERFACE opencv_core opencv_imgproc opencv_imgcodecs opencv_features2d
                                             opencv_calib3d)

# Only GCC's precompiled headers go with ccache in the way that is set above.
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  set(ROMAP_PRECOMPILE ON)
else()
  set(ROMAP_PRECOMPILE OFF)
endif()

# Eigen, OpenCV's matrices and Abseil would take five seconds of every compilation, so they are parsed only once. All
# targets share the one precompiled header, so the compile definitions of these libraries must be the same in all
# targets.
if(ROMAP_PRECOMPILE)
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled.cc CONTENT "")  # keeps its time, unlike file(WRITE)
  add_library(romap_precompiled OBJECT ${CMAKE_BINARY_DIR}/precompiled.cc)
  target_link_libraries(romap_precompiled PRIVATE romap_opencv Eigen3::Eigen absl::status absl::statusor fmt::fmt)
  target_compile_options(romap_precompiled PRIVATE -fpch-preprocess)
  target_precompile_headers(romap_precompiled PRIVATE
    <algorithm> <chrono> <cmath> <cstdint> <functional> <map> <memory> <mutex> <optional> <string> <thread> <vector>
    <Eigen/Core> <Eigen/Geometry> <opencv2/core/mat.hpp> <absl/status/statusor.h> <fmt/format.h>)
endif()

# Tests also share GoogleTest. The speed of test code does not matter, so it is compiled with little optimization.
set(ROMAP_TEST_OPTIMIZATION -O1)
set(ROMAP_TEST_TIMEOUT_s 300)
if(ROMAP_SANITIZER)
  set(ROMAP_TEST_TIMEOUT_s 2400)
endif()
if(ROMAP_BUILD_TESTS AND ROMAP_PRECOMPILE)
  find_package(GTest CONFIG REQUIRED)
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled_tests.cc CONTENT "")
  add_library(romap_precompiled_tests OBJECT ${CMAKE_BINARY_DIR}/precompiled_tests.cc)
  target_link_libraries(romap_precompiled_tests PRIVATE romap_opencv Eigen3::Eigen absl::status absl::statusor
                                                        fmt::fmt GTest::gmock)
  target_compile_options(romap_precompiled_tests PRIVATE -fpch-preprocess ${ROMAP_TEST_OPTIMIZATION})
  target_precompile_headers(romap_precompiled_tests PRIVATE
    <algorithm> <chrono> <cmath> <cstdint> <filesystem> <fstream> <functional> <map> <memory> <mutex> <optional> <random>
    <string> <thread> <vector> <Eigen/Core> <Eigen/Geometry> <opencv2/core/mat.hpp> <absl/status/statusor.h> <fmt/format.h>
    <gmock/gmock.h> <gtest/gtest.h>)
endif()

# Parsing headers and writing debug information or templates once for several sources takes less than half of the time.
# Helpers in unnamed namespaces must therefore have different names within a folder; each test has a namespace of its
# own. Without it (-DROMAP_UNITY=OFF), a changed source is compiled alone.
option(ROMAP_UNITY "Compile several sources of a folder together" ON)
set(ROMAP_UNITY_SIZE 8)

function(romap_precompile target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${ROMAP_UNITY} UNITY_BUILD_BATCH_SIZE ${ROMAP_UNITY_SIZE})
  target_link_libraries(${target} PRIVATE fmt::fmt)
  if(ROMAP_PRECOMPILE)
    target_precompile_headers(${target} REUSE_FROM romap_precompiled)
    target_compile_options(${target} PRIVATE -fpch-preprocess)
  endif()
endfunction()

# romap_library(name [PUBLIC targets...] [PRIVATE targets...] [SOURCES files...])
# A static library `romap_<name>` of all *.cc in the folder (or of SOURCES). Links are the layering: a folder may
# include only what it links.
function(romap_library name)
  cmake_parse_arguments(ARG "" "" "PUBLIC;PRIVATE;SOURCES" ${ARGN})
  if(NOT ARG_SOURCES)
    file(GLOB ARG_SOURCES CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cc)
  endif()
  if(ARG_SOURCES)
    add_library(romap_${name} STATIC ${ARG_SOURCES})
    target_include_directories(romap_${name} PUBLIC $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}>)
    target_link_libraries(romap_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
    romap_precompile(romap_${name})
  else()
    add_library(romap_${name} INTERFACE)
    target_include_directories(romap_${name} INTERFACE ${CMAKE_SOURCE_DIR})
    target_link_libraries(romap_${name} INTERFACE ${ARG_PUBLIC} ${ARG_PRIVATE})
  endif()
endfunction()

# romap_tests(folder [SHARDS count] [COST seconds] [MAY_SKIP filter] [LIBS targets...]): one GoogleTest program
# `<folder with _>_test` of all *_test.cc in the current folder. It runs as `count` processes, each with its share of the
# test cases, so that they run in parallel. A process per test case would spend more time on loading libraries than on
# testing. CTest starts the most costly processes first. Cases that may be skipped (a GoogleTest filter) are tests of their own, so that CTest shows it.
function(romap_tests name)
  cmake_parse_arguments(ARG "" "SHARDS;COST;MAY_SKIP" "LIBS" ${ARGN})
  if(NOT ARG_SHARDS)
    set(ARG_SHARDS 1)
  endif()
  if(NOT ARG_COST)
    set(ARG_COST 1)
  endif()
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*_test.cc)
  if(NOT sources)
    return()
  endif()
  add_executable(${name}_test ${sources})
  target_link_libraries(${name}_test PRIVATE ${ARG_LIBS} GTest::gmock_main fmt::fmt)
  set_target_properties(${name}_test PROPERTIES UNITY_BUILD ${ROMAP_UNITY} UNITY_BUILD_BATCH_SIZE ${ROMAP_UNITY_SIZE})
  # GoogleTest's macros contain __FILE__, which would be different in every clone. The precompiled header does not get
  # this option, because it would contain the path itself.
  target_compile_options(${name}_test PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fmacro-prefix-map=${CMAKE_SOURCE_DIR}/=>)
  target_compile_options(${name}_test PRIVATE ${ROMAP_TEST_OPTIMIZATION})
  if(ROMAP_PRECOMPILE)
    target_precompile_headers(${name}_test REUSE_FROM romap_precompiled_tests)
    target_compile_options(${name}_test PRIVATE -fpch-preprocess)
  endif()
  foreach(shard RANGE 1 ${ARG_SHARDS})
    math(EXPR index "${shard} - 1")
    set(test ${name}_test.${shard}_of_${ARG_SHARDS})
    add_test(NAME ${test} COMMAND ${name}_test --gtest_brief=1 --gtest_filter=-${ARG_MAY_SKIP})
    set_tests_properties(${test} PROPERTIES TIMEOUT ${ROMAP_TEST_TIMEOUT_s} COST ${ARG_COST}
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${index}")
  endforeach()
  if(ARG_MAY_SKIP)
    gtest_discover_tests(${name}_test TEST_FILTER "${ARG_MAY_SKIP}" DISCOVERY_TIMEOUT 60
                         PROPERTIES TIMEOUT ${ROMAP_TEST_TIMEOUT_s})
  endif()
endfunction()
