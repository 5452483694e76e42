# find_package(dupin) for whoever installs us.
include(CMakePackageConfigHelpers)
install(TARGETS dupin EXPORT dupinTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/dupin ${PROJECT_BINARY_DIR}/generated/dupin
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(EXPORT dupinTargets NAMESPACE dupin:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/dupin)
file(WRITE ${PROJECT_BINARY_DIR}/dupinConfig.cmake
"include(CMakeFindDependencyMacro)
find_dependency(Eigen3 3.4)
if(${DUPIN_THREADS})
  find_dependency(TBB)
endif()
if(${DUPIN_IO})
  find_dependency(ZLIB)
  find_dependency(PNG)
endif()
include(\${CMAKE_CURRENT_LIST_DIR}/dupinTargets.cmake)
")
write_basic_package_version_file(${PROJECT_BINARY_DIR}/dupinConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/dupinConfig.cmake ${PROJECT_BINARY_DIR}/dupinConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/dupin)
if(TARGET dupin_cli)
  install(TARGETS dupin_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()
