# How every target of the project is compiled. Usage:
#   planish_library(NAME sources... PUBLIC deps... PRIVATE deps...)
#   planish_executable(NAME sources... PRIVATE deps...)
# Include paths are relative to the repository's root ("core/abf/newton.h").

function(planish_compile_options target)
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wold-style-cast)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    # GCC 12 sees overlapping copies in std::string concatenation where there are none (GCC bug 105651).
    target_compile_options(${target} PRIVATE -Wno-restrict)
  endif()
  if(PLANISH_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(PLANISH_SANITIZE)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # False in std::function and std::variant of libstdc++, where checks of sanitizers lie between.
      target_compile_options(${target} PRIVATE -Wno-maybe-uninitialized)
    endif()
    target_compile_options(${target} PUBLIC -fsanitize=${PLANISH_SANITIZE} -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${PLANISH_SANITIZE})
  endif()
endfunction()

function(planish_library name)
  cmake_parse_arguments(ARG "" "" "PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_UNPARSED_ARGUMENTS})
  planish_compile_options(${name})
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
endfunction()

function(planish_executable name)
  cmake_parse_arguments(ARG "" "" "PRIVATE" ${ARGN})
  add_executable(${name} ${ARG_UNPARSED_ARGUMENTS})
  planish_compile_options(${name})
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE})
endfunction()
