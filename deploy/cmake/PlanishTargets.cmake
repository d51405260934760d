# How every target of the project is compiled. Usage:
#   planish_library(NAME sources... PUBLIC deps... PRIVATE deps... [PCH header... | PCH_OF other])
#   planish_executable(NAME sources... PRIVATE deps... [PCH ...])
# Include paths are relative to the repository's root ("core/abf/newton.h").
#
# Headers take most of the time of a build, so each is compiled only a few times:
# - PLANISH_UNITY: the sources of a target are compiled together, PLANISH_UNITY_BATCH of them at a time. The names in
#   their anonymous namespaces must therefore differ.
# - PLANISH_PCH: heavy headers of other projects are precompiled by the targets that name them after PCH, and used by
#   targets that name such a target after PCH_OF. A source must still include what it uses.
# Both are ON by default; the preset "clang" builds without either.
#
# A folder whose code mostly waits (for sockets, files, people) sets PLANISH_OPTIMIZE to -O1, which compiles in half the
# time of -O3. Nothing is optimized with CMAKE_BUILD_TYPE=Debug.

# PCH_OF: both targets must be compiled with the same -O, -std and -f.
function(planish_precompile target)
  cmake_parse_arguments(ARG "" "PCH_OF" "PCH" ${ARGN})
  if(NOT PLANISH_PCH)
    return()
  endif()
  if(ARG_PCH)
    target_precompile_headers(${target} PRIVATE ${ARG_PCH})
  elseif(ARG_PCH_OF)
    target_precompile_headers(${target} REUSE_FROM ${ARG_PCH_OF})
  endif()
endfunction()

function(planish_sanitize target)
  if(NOT PLANISH_SANITIZE)
    return()
  endif()
  target_compile_options(${target} PUBLIC -fsanitize=${PLANISH_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(${target} PUBLIC -fsanitize=${PLANISH_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # False warnings in std::function and std::variant of libstdc++ when sanitizers add checks.
    target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized)
    if(PLANISH_SANITIZE STREQUAL "thread")
      # Undefines __SANITIZE_THREAD__: with it, protobuf's headers give map fields two more members, which Debian's
      # library was built without. libstdc++ derives _GLIBCXX_TSAN from it, so that is defined here instead.
      target_compile_options(${target} PUBLIC -U__SANITIZE_THREAD__ -D_GLIBCXX_TSAN=1)
    endif()
  endif()
endfunction()

function(planish_compile_options target)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wold-style-cast)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    # GCC 12 wrongly warns of overlapping copies in std::string concatenation (GCC bug 105651).
    target_compile_options(${target} PRIVATE -Wno-restrict)
  endif()
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    target_compile_options(${target} PRIVATE ${PLANISH_OPTIMIZE})
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # Lets GCC collect garbage only beyond half a GB, which saves a tenth of the build time.
    target_compile_options(${target} PRIVATE --param=ggc-min-heapsize=500000)
  endif()
  if(PLANISH_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(PLANISH_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${PLANISH_UNITY_BATCH})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # GCC treats a source that another one includes as a header, and warns of anonymous namespaces in it.
      target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
    endif()
  endif()
  planish_sanitize(${target})
endfunction()

function(planish_library name)
  cmake_parse_arguments(ARG "" "PCH_OF" "PUBLIC;PRIVATE;PCH" ${ARGN})
  add_library(${name} STATIC ${ARG_UNPARSED_ARGUMENTS})
  planish_compile_options(${name})
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  planish_precompile(${name} PCH ${ARG_PCH} PCH_OF ${ARG_PCH_OF})
endfunction()

function(planish_executable name)
  cmake_parse_arguments(ARG "" "PCH_OF" "PRIVATE;PCH" ${ARGN})
  add_executable(${name} ${ARG_UNPARSED_ARGUMENTS})
  planish_compile_options(${name})
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE})
  planish_precompile(${name} PCH ${ARG_PCH} PCH_OF ${ARG_PCH_OF})
endfunction()
