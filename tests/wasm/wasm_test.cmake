# cmake -DSOURCE=dir -DWORK=dir -DEMCC=em++ -DNODE=node -DPython3=python3 -DEigen3_DIR=dir
#   -DNATIVE=program -P wasm_test.cmake
# Compiles the library without io and threads with emscripten and compares the keypoints that the same
# program finds in node with those of the native one: same vertices and levels, responses within 1e-9.
function(must)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE out)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${status}:\n${out}")
  endif()
endfunction()

# Boost is a folder of the host's /usr/include, which must not be searched for anything else.
find_path(boost_folder boost/math/policies/policy.hpp PATHS /usr/include /usr/local/include REQUIRED)
file(MAKE_DIRECTORY ${WORK}/boost)
file(CREATE_LINK ${boost_folder}/boost ${WORK}/boost/boost SYMBOLIC)
get_filename_component(emcc_folder ${EMCC} DIRECTORY)
must(${emcc_folder}/emcmake ${CMAKE_COMMAND} -G Ninja -S ${SOURCE} -B ${WORK}/build
  -DCMAKE_BUILD_TYPE=Release -DDUPIN_IO=OFF -DDUPIN_THREADS=OFF -DDUPIN_APPS=OFF
  -DEigen3_DIR=${Eigen3_DIR}
  -DBoost_NO_BOOST_CMAKE=ON -DBoost_INCLUDE_DIR=${WORK}/boost)
must(${CMAKE_COMMAND} --build ${WORK}/build -j 2)
# -O1: from -O2 on em++ also wants the JavaScript package acorn. Compiled while loading: em++ 3.1 otherwise
# fetches the .wasm file by its path, which node refuses from version 18 on.
must(${EMCC} -O1 -std=c++20 -fexceptions -s ALLOW_MEMORY_GROWTH=1 -s WASM_ASYNC_COMPILATION=0 -I${SOURCE}/src -isystem ${Eigen3_DIR}/../../../include/eigen3
  ${SOURCE}/tests/consumer/keypoints.cpp ${WORK}/build/src/dupin/libdupin.a -o ${WORK}/keypoints.js)
must(${Python3} ${SOURCE}/tests/wasm/same_keypoints.py ${NATIVE} ${NODE} ${WORK}/keypoints.js)
