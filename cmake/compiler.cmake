# Compiler, linker and sanitizer settings that hold for every target.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_C_STANDARD 11)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
# Link-time inlining across translation units would be one more thing that may differ between builds.
set(CMAKE_INTERPROCEDURAL_OPTIMIZATION OFF)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "Build type" FORCE)
endif()
set(CMAKE_C_FLAGS_RELWITHDEBINFO "-O2 -g1 -DNDEBUG")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1 -DNDEBUG")

add_compile_options(
  -Wall -Wextra
  # A picture must not depend on whether the host has FMA: the IR alone says where operations fuse.
  -ffp-contract=off
  # Only the loader's entry points leave the shared library.
  -fvisibility=hidden
  $<$<COMPILE_LANGUAGE:CXX>:-fvisibility-inlines-hidden>)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A unique symbol would pin the driver in memory: dlclose() must really unload it.
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fno-gnu-unique>)
endif()

option(PUMICE_USE_CCACHE "Compile through ccache when it is installed" ON)
if(PUMICE_USE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(PUMICE_CCACHE ccache)
  if(PUMICE_CCACHE)
    set(CMAKE_C_COMPILER_LAUNCHER "${PUMICE_CCACHE}")
    set(CMAKE_CXX_COMPILER_LAUNCHER "${PUMICE_CCACHE}")
  endif()
endif()

option(PUMICE_USE_MOLD "Link with mold when it is installed" ON)
if(PUMICE_USE_MOLD)
  find_program(PUMICE_MOLD mold)
  if(PUMICE_MOLD)
    include(CheckLinkerFlag)
    check_linker_flag(CXX -fuse-ld=mold PUMICE_LINKER_IS_MOLD)
    if(PUMICE_LINKER_IS_MOLD)
      add_link_options(-fuse-ld=mold)
    endif()
  endif()
endif()

# "address", "undefined" or "thread", or a comma separated list of them.
set(PUMICE_SANITIZE "" CACHE STRING "Sanitizers to build with")
if(PUMICE_SANITIZE)
  # gcc's flow analysis gives false alarms in instrumented code.
  add_compile_options(-fsanitize=${PUMICE_SANITIZE} -fno-omit-frame-pointer -Wno-maybe-uninitialized)
  add_link_options(-fsanitize=${PUMICE_SANITIZE})
  if(PUMICE_SANITIZE MATCHES "undefined")
    add_compile_options(-fno-sanitize-recover=undefined)
    # For files that use classes of libraries built without type information.
    set(PUMICE_WITHOUT_TYPE_INFORMATION -fno-sanitize=vptr)
  endif()
  # An uninstrumented program that loads the instrumented driver needs this in LD_PRELOAD.
  if(PUMICE_SANITIZE MATCHES "address")
    set(PUMICE_SANITIZER_LIBRARY libasan.so)
  elseif(PUMICE_SANITIZE MATCHES "thread")
    set(PUMICE_SANITIZER_LIBRARY libtsan.so)
  else()
    set(PUMICE_SANITIZER_LIBRARY libubsan.so)
  endif()
  execute_process(COMMAND "${CMAKE_CXX_COMPILER}" -print-file-name=${PUMICE_SANITIZER_LIBRARY}
    OUTPUT_VARIABLE PUMICE_SANITIZER_RUNTIME OUTPUT_STRIP_TRAILING_WHITESPACE)
  file(REAL_PATH "${PUMICE_SANITIZER_RUNTIME}" PUMICE_SANITIZER_RUNTIME)
endif()

# Unity builds make a clean build of a room much cheaper; while debugging they are in the way.
option(PUMICE_UNITY "Let rooms that allow it be compiled in batches of eight files" ON)
if(PUMICE_SANITIZE OR CMAKE_BUILD_TYPE STREQUAL "Debug")
  set(PUMICE_UNITY OFF)
endif()

find_package(Threads REQUIRED)
