# dupin_module(NAME SOURCES a.cpp ... HEADERS a.h ... [DEPENDS lower modules] [PRIVATE libs])
#
# Each module is an object library that links only the modules it names, so an
# upward include shows up at link or review time; tools/check_floors.py is the rule.
function(dupin_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;DEPENDS;PRIVATE" ${ARGN})
  add_library(dupin_${name} OBJECT ${ARG_SOURCES})
  target_sources(dupin_${name} PUBLIC FILE_SET HEADERS
    BASE_DIRS ${PROJECT_SOURCE_DIR}/src FILES ${ARG_HEADERS})
  target_include_directories(dupin_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>)
  target_link_libraries(dupin_${name} PUBLIC Eigen3::Eigen PRIVATE $<BUILD_INTERFACE:dupin_options>)
  foreach(lower IN LISTS ARG_DEPENDS)
    target_link_libraries(dupin_${name} PUBLIC dupin_${lower})
  endforeach()
  if(ARG_PRIVATE)
    target_link_libraries(dupin_${name} PRIVATE ${ARG_PRIVATE})
  endif()
  set_property(GLOBAL APPEND PROPERTY DUPIN_MODULES ${name})
  list(TRANSFORM ARG_HEADERS PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set_property(GLOBAL APPEND PROPERTY DUPIN_PUBLIC_HEADERS ${ARG_HEADERS})
  set_property(GLOBAL APPEND PROPERTY DUPIN_PRIVATE_LIBS ${ARG_PRIVATE})
endfunction()
