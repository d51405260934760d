# What `cmake --install` puts in place for users of the library: headers, one archive, a CMake package.
#
# The archive holds the objects of the client and of the internal libraries it stands on, so that nothing internal
# has to be installed or exported.
include(CMakePackageConfigHelpers)

add_library(planish_sdk STATIC
  $<TARGET_OBJECTS:planish_client>
  $<TARGET_OBJECTS:planish_proto>
  $<TARGET_OBJECTS:planish_draco>
  $<TARGET_OBJECTS:planish_base>)
set_target_properties(planish_sdk PROPERTIES
  OUTPUT_NAME planish_client EXPORT_NAME client LINKER_LANGUAGE CXX
  # Beside planish_client's own archive there is no room for a second of the same name.
  ARCHIVE_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/sdk)
target_compile_features(planish_sdk INTERFACE cxx_std_20)
target_link_libraries(planish_sdk INTERFACE
  gRPC::grpc++ protobuf::libprotobuf draco::draco absl::status absl::statusor absl::strings OpenSSL::SSL
  Threads::Threads)
if(PLANISH_SANITIZE)
  target_link_options(planish_sdk INTERFACE -fsanitize=${PLANISH_SANITIZE})
endif()
add_library(planish::client ALIAS planish_client)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/planish)
configure_package_config_file(cmake/planish-config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/planish-config.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/planish-config-version.cmake
  COMPATIBILITY SameMinorVersion)

install(TARGETS planish RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS planish_sdk EXPORT planish-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY include/planish DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT planish-targets NAMESPACE planish:: DESTINATION ${package_dir})
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/planish-config.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/planish-config-version.cmake DESTINATION ${package_dir})
