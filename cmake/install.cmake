# find_package(dupin) for whoever installs us: the library, the headers that dupin_module() names as
# public, and the program.
include(CMakePackageConfigHelpers)
set(dupin_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/dupin)

install(TARGETS dupin EXPORT dupinTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT dupinTargets NAMESPACE dupin:: DESTINATION ${dupin_package_dir})

get_property(public_headers GLOBAL PROPERTY DUPIN_PUBLIC_HEADERS)
foreach(header IN LISTS public_headers)
  cmake_path(RELATIVE_PATH header BASE_DIRECTORY ${PROJECT_SOURCE_DIR}/src OUTPUT_VARIABLE relative)
  cmake_path(GET relative PARENT_PATH folder)
  install(FILES ${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder})
endforeach()
install(FILES ${PROJECT_BINARY_DIR}/generated/dupin/base/version.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/dupin/base)

# A static library passes the libraries of its parts on to the linker of its users.
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/dupinConfig.cmake.in
  ${PROJECT_BINARY_DIR}/dupinConfig.cmake INSTALL_DESTINATION ${dupin_package_dir}
  NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/dupinConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/dupinConfig.cmake ${PROJECT_BINARY_DIR}/dupinConfigVersion.cmake
  DESTINATION ${dupin_package_dir})

if(TARGET dupin_cli)
  install(TARGETS dupin_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
