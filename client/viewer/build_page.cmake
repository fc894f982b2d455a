# One step of the build of the page: STEP=packages installs the packages into STAGE, STEP=page builds into DIST. Without
# the packages, e.g. without a network, the build goes on without the page.
if(STEP STREQUAL packages)
  file(MAKE_DIRECTORY ${STAGE} ${DIST})
  file(REMOVE_RECURSE ${STAGE}/node_modules)
  file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/.npmrc DESTINATION ${STAGE})
  execute_process(COMMAND ${NPM} ci --no-progress --fetch-retries=1 --fetch-timeout=60000
                  WORKING_DIRECTORY ${STAGE} RESULT_VARIABLE failed OUTPUT_VARIABLE log ERROR_VARIABLE log)
  if(failed)
    file(REMOVE_RECURSE ${STAGE}/node_modules)
    string(REGEX MATCH "[^\n]*npm (ERR!|error)[^\n]*" reason "${log}")
    message("client/viewer: npm could not install its packages (${reason}); romap-server is built without its page. "
            "Run cmake again to try it again.")
  endif()
  return()
endif()

file(REMOVE_RECURSE ${DIST} ${STAGE}/src)
file(MAKE_DIRECTORY ${DIST})
if(NOT EXISTS ${STAGE}/node_modules/vite)
  return()
endif()
file(COPY ${SOURCE}/src ${SOURCE}/index.html ${SOURCE}/camera.html ${SOURCE}/vite.config.ts ${SOURCE}/tsconfig.json
     DESTINATION ${STAGE})
foreach(command "node_modules/typescript/bin/tsc;--noEmit" "node_modules/vite/bin/vite.js;build;--logLevel;warn")
  execute_process(COMMAND ${CMAKE_COMMAND} -E env ROMAP_VIEWER_OUT=${DIST} ${NODE} ${command}
                  WORKING_DIRECTORY ${STAGE} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "client/viewer: the page could not be built")
  endif()
endforeach()
