# The shared library, and what `cmake --install` installs for programs that use it: headers, a CMake package, a file for
# pkg-config. A COMPONENT is a package (deploy/packages).
#
# The library contains the objects of the client and of the internal libraries that the client uses. Only planish::abiN
# is visible (exports.map.in), and headers use standard types only, so a program that uses libplanish is compiled
# without gRPC and without our internal headers.
include(CMakePackageConfigHelpers)

configure_file(cmake/exports.map.in exports.map @ONLY)
add_library(planish_sdk SHARED
  $<TARGET_OBJECTS:planish_client>
  $<TARGET_OBJECTS:planish_proto>
  $<TARGET_OBJECTS:planish_draco>
  $<TARGET_OBJECTS:planish_base>)
set_target_properties(planish_sdk PROPERTIES
  OUTPUT_NAME planish EXPORT_NAME client LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION} SOVERSION ${PLANISH_ABI}
  LINK_DEPENDS ${CMAKE_CURRENT_BINARY_DIR}/exports.map)
target_compile_features(planish_sdk INTERFACE cxx_std_20)
target_link_libraries(planish_sdk PRIVATE
  gRPC::grpc++ protobuf::libprotobuf draco::draco absl::status absl::statusor absl::strings OpenSSL::SSL Threads::Threads)
target_link_options(planish_sdk PRIVATE
  -Wl,--version-script=${CMAKE_CURRENT_BINARY_DIR}/exports.map -Wl,--as-needed)
if(NOT PLANISH_SANITIZE)  # clang links the sanitizers' functions into programs only, not into libraries
  target_link_options(planish_sdk PRIVATE -Wl,--no-undefined)
endif()
planish_sanitize(planish_sdk)
add_library(planish::client ALIAS planish_client)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/planish)
configure_package_config_file(cmake/planish-config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/planish-config.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/planish-config-version.cmake
  COMPATIBILITY SameMinorVersion)
# The prefix in planish.pc is relative to the file itself, so that an installation may be moved.
file(RELATIVE_PATH prefix_of_pc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(cmake/planish.pc.in planish.pc @ONLY)

install(TARGETS planish RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT planish)
install(TARGETS planish_sdk EXPORT planish-targets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  COMPONENT libplanish NAMELINK_COMPONENT libplanish-dev
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY include/planish DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT libplanish-dev)
install(EXPORT planish-targets NAMESPACE planish:: DESTINATION ${package_dir} COMPONENT libplanish-dev)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/planish-config.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/planish-config-version.cmake DESTINATION ${package_dir} COMPONENT libplanish-dev)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/planish.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT libplanish-dev)
