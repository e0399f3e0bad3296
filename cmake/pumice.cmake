# The few functions from which every folder's CMakeLists.txt is made.

# pumice_room(<name> [UNITY] SOURCES <files...> [LIBS <targets...>])
#
# A static, position independent library pumice_<name>. Includes are relative to the repository root.
# UNITY says that the room's files may be compiled in batches (no clashing names in their anonymous
# namespaces); it has no effect in debug and sanitizer builds.
function(pumice_room name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "UNITY" "" "SOURCES;LIBS")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "pumice_room(${name}): unknown arguments ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  set(target pumice_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  target_include_directories(${target} PUBLIC "${PROJECT_SOURCE_DIR}")
  target_link_libraries(${target} PUBLIC ${ARG_LIBS} Threads::Threads)
  if(ARG_UNITY AND PUMICE_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  endif()
endfunction()

# pumice_test(<name> SOURCES <files...> [LIBS <targets...>] [TIMEOUT <seconds>] [LABELS <labels...>]
#             [ENV <NAME=value...>] [SERIAL] [ONE_PROCESS] [NO_MAIN])
#
# A GoogleTest program test_<name>, every TEST of which is one ctest test "<name>.<Suite>.<Test>".
# ENV is added to each test's environment; SERIAL tests run alone; ONE_PROCESS registers the program as
# a single ctest test (for programs whose set-up is dear); NO_MAIN leaves main() to the sources.
# Sanitizers slow programs down: the timeout is multiplied by four there, and PUMICE_SANITIZER_RUNTIME is
# defined: the library that a child process which is not instrumented needs in LD_PRELOAD.
function(pumice_test name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "SERIAL;ONE_PROCESS;NO_MAIN" "TIMEOUT" "SOURCES;LIBS;LABELS;ENV")
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "pumice_test(${name}): unknown arguments ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  set(target test_${name})
  add_executable(${target} ${ARG_SOURCES})
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
  target_compile_definitions(${target} PRIVATE PUMICE_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(${target} PRIVATE ${ARG_LIBS} GTest::gtest Threads::Threads)
  if(PUMICE_SANITIZE)
    target_sources(${target} PRIVATE "${PROJECT_SOURCE_DIR}/tests/sanitizers/keep_loaded.cpp")
    target_compile_definitions(${target} PRIVATE PUMICE_SANITIZER_RUNTIME="${PUMICE_SANITIZER_RUNTIME}")
  endif()
  if(NOT ARG_NO_MAIN)
    target_link_libraries(${target} PRIVATE GTest::gtest_main)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 60)
  endif()
  if(PUMICE_SANITIZE)
    math(EXPR ARG_TIMEOUT "${ARG_TIMEOUT} * 4")
  endif()
  set(properties TIMEOUT ${ARG_TIMEOUT})
  if(ARG_SERIAL)
    list(APPEND properties RUN_SERIAL TRUE)
  endif()
  if(ARG_ONE_PROCESS)
    add_test(NAME ${name} COMMAND ${target})
    set_tests_properties(${name} PROPERTIES ${properties})
    if(ARG_LABELS)
      set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}")
    endif()
    if(ARG_ENV)
      set_tests_properties(${name} PROPERTIES ENVIRONMENT "${ARG_ENV}")
    endif()
  else()
    if(ARG_LABELS)
      list(APPEND properties LABELS ${ARG_LABELS})
    endif()
    if(ARG_ENV)
      # gtest_discover_tests flattens lists: several variables go in one by one.
      set(modifications "")
      foreach(variable IN LISTS ARG_ENV)
        string(REGEX REPLACE "^([^=]*)=(.*)$" "\\1=set:\\2" modification "${variable}")
        list(APPEND modifications "${modification}")
      endforeach()
      string(REPLACE ";" "\\;" modifications "${modifications}")
      list(APPEND properties ENVIRONMENT_MODIFICATION "${modifications}")
    endif()
    gtest_discover_tests(${target}
      TEST_PREFIX "${name}."
      DISCOVERY_MODE PRE_TEST
      DISCOVERY_TIMEOUT 60
      PROPERTIES ${properties})
  endif()
endfunction()

# pumice_manifest(<target> <api_version>)
#
# The two manifests by which the Vulkan loader finds the driver <target>:
#   <build>/pumice_icd.<cpu>.json                      names the library in the build tree;
#   <prefix>/share/vulkan/icd.d/pumice_icd.<cpu>.json  names the installed one by a relative path, so the
#                                                      installed tree may be moved as a whole.
# <api_version> must be what vkGetPhysicalDeviceProperties reports: the loader believes the manifest.
# Installs the library and the manifest.
function(pumice_manifest target api_version)
  set(manifest_name "pumice_icd.${CMAKE_SYSTEM_PROCESSOR}.json")

  set(PUMICE_ICD_API_VERSION "${api_version}")
  set(PUMICE_ICD_LIBRARY "$<TARGET_FILE:${target}>")
  configure_file("${PROJECT_SOURCE_DIR}/cmake/pumice_icd.json.in"
    "${CMAKE_CURRENT_BINARY_DIR}/build_tree_icd.json.gen" @ONLY)
  file(GENERATE OUTPUT "${PROJECT_BINARY_DIR}/${manifest_name}"
    INPUT "${CMAKE_CURRENT_BINARY_DIR}/build_tree_icd.json.gen")

  set(manifest_dir "${CMAKE_INSTALL_DATADIR}/vulkan/icd.d")
  file(RELATIVE_PATH library_dir
    "${CMAKE_INSTALL_FULL_DATADIR}/vulkan/icd.d" "${CMAKE_INSTALL_FULL_LIBDIR}")
  set(PUMICE_ICD_LIBRARY "${library_dir}/$<TARGET_FILE_NAME:${target}>")
  configure_file("${PROJECT_SOURCE_DIR}/cmake/pumice_icd.json.in"
    "${CMAKE_CURRENT_BINARY_DIR}/installed_icd.json.gen" @ONLY)
  file(GENERATE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/installed/${manifest_name}"
    INPUT "${CMAKE_CURRENT_BINARY_DIR}/installed_icd.json.gen")

  install(TARGETS ${target} LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/installed/${manifest_name}" DESTINATION "${manifest_dir}")
endfunction()
