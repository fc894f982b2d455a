# What the programs are made of: one table of the libraries, for `--version --verbose` and for the SBOM.

# NAME | version | SPDX id of the license | package of the distribution that has it
set(ROMAP_LIBRARIES
  "Abseil|${absl_VERSION}|Apache-2.0|libabsl-dev"
  "Ceres Solver|${Ceres_VERSION}|BSD-3-Clause|libceres-dev"
  "CLI11||BSD-3-Clause|libcli11-dev"
  "Draco|${draco_VERSION}|Apache-2.0|libdraco-dev"
  "Eigen|${Eigen3_VERSION}|MPL-2.0|libeigen3-dev"
  "fmt|${fmt_VERSION}|MIT|libfmt-dev"
  "gRPC|${gRPC_VERSION}|Apache-2.0|libgrpc++-dev"
  "Highway|${HWY_VERSION}|Apache-2.0|libhwy-dev"
  "libevent|${LIBEVENT_VERSION}|BSD-3-Clause|libevent-dev"
  "libexif||LGPL-2.1-or-later|libexif-dev"
  "libjpeg-turbo||IJG AND BSD-3-Clause AND Zlib|libjpeg62-turbo-dev"
  "libpng|${PNG_VERSION_STRING}|libpng-2.0|libpng-dev"
  "libsodium|${SODIUM_VERSION}|ISC|libsodium-dev"
  "libsystemd||LGPL-2.1-or-later|libsystemd-dev"
  "meshoptimizer|${meshoptimizer_VERSION}|MIT|libmeshoptimizer-dev"
  "nanoflann|${nanoflann_VERSION}|BSD-2-Clause|libnanoflann-dev"
  "nlohmann json|${nlohmann_json_VERSION}|MIT|nlohmann-json3-dev"
  "oneTBB|${TBB_VERSION}|Apache-2.0|libtbb-dev"
  "OpenCV|${OpenCV_VERSION}|Apache-2.0|libopencv-dev"
  "OpenSSL|${OPENSSL_VERSION}|Apache-2.0|libssl-dev"
  "prometheus-cpp|${prometheus-cpp_VERSION}|MIT|prometheus-cpp-dev"
  "Protocol Buffers|${Protobuf_VERSION}|BSD-3-Clause|libprotobuf-dev"
  "spdlog|${spdlog_VERSION}|MIT|libspdlog-dev"
  "SQLite||blessing|libsqlite3-dev"
  "SQLiteCpp|${SQLiteCpp_VERSION}|MIT|libsqlitecpp-dev"
  "stb||MIT OR Unlicense|libstb-dev"
  "tinygltf|${TinyGLTF_VERSION}|MIT|libtinygltf-dev"
  "tinyobjloader|${tinyobjloader_VERSION}|MIT|libtinyobjloader-dev"
  "UTF8-CPP|${utf8cpp_VERSION}|BSL-1.0|libutfcpp-dev"
  "xxHash|${XXHASH_VERSION}|BSD-2-Clause|libxxhash-dev"
  "yaml-cpp|${yaml-cpp_VERSION}|MIT|libyaml-cpp-dev")

# The version of a package of the distribution; empty: not known.
function(romap_package_version package result)
  execute_process(COMMAND dpkg-query -W -f "\${Version}" ${package}
                  OUTPUT_VARIABLE version ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  set(${result} "${version}" PARENT_SCOPE)
endfunction()

# romap_add_part(id name version license purl): appends a part to `packages` and `described` of the caller, in SPDX.
function(romap_add_part id name version license purl)
  string(MAKE_C_IDENTIFIER "${id}" id)
  string(REPLACE "_" "-" id "${id}")
  set(packages "${packages},
    {\"SPDXID\": \"SPDXRef-${id}\", \"name\": \"${name}\", \"versionInfo\": \"${version}\",
     \"downloadLocation\": \"NOASSERTION\", \"filesAnalyzed\": false, \"licenseConcluded\": \"NOASSERTION\",
     \"licenseDeclared\": \"${license}\", \"copyrightText\": \"NOASSERTION\",
     \"externalRefs\": [{\"referenceCategory\": \"PACKAGE-MANAGER\", \"referenceType\": \"purl\",
                       \"referenceLocator\": \"${purl}\"}]}" PARENT_SCOPE)
  set(described "${described},
    {\"spdxElementId\": \"SPDXRef-romap\", \"relationshipType\": \"DEPENDS_ON\", \"relatedSpdxElement\": \"SPDXRef-${id}\"}" PARENT_SCOPE)
endfunction()

function(romap_write_libraries)
  set(lines "")
  set(packages "")
  set(described "")
  foreach(library IN LISTS ROMAP_LIBRARIES)
    string(REPLACE "|" ";" fields "${library}")
    list(GET fields 0 name)
    list(GET fields 1 version)
    list(GET fields 2 license)
    list(GET fields 3 package)
    romap_package_version(${package} package_version)
    if(NOT version)  # without the epoch and the revision of the package
      string(REGEX REPLACE "^[0-9]+:|[-+~].*$" "" version "${package_version}")
    endif()
    string(APPEND lines "    {\"${name}\", \"${version}\"},\n")
    string(REPLACE "+" "%2B" purl "${package}@${package_version}")
    romap_add_part("${package}" "${name}" "${version}" "${license}" "pkg:deb/debian/${purl}?distro=debian-12")
  endforeach()

  # The packages of the page, which is part of romap-server.
  file(READ ${CMAKE_SOURCE_DIR}/client/viewer/package.json manifest)
  file(READ ${CMAKE_SOURCE_DIR}/client/viewer/package-lock.json lock)
  string(JSON count LENGTH "${manifest}" dependencies)
  math(EXPR last "${count} - 1")
  foreach(index RANGE ${last})
    string(JSON name MEMBER "${manifest}" dependencies ${index})
    string(JSON version GET "${lock}" packages "node_modules/${name}" version)
    string(JSON license GET "${lock}" packages "node_modules/${name}" license)
    string(REPLACE "@" "%40" purl "${name}")
    romap_add_part("npm_${name}" "${name}" "${version}" "${license}" "pkg:npm/${purl}@${version}")
  endforeach()

  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/libraries.inc CONTENT "${lines}")
  string(SHA1 digest "${packages}${described}")
  string(TIMESTAMP now "%Y-%m-%dT%H:%M:%SZ" UTC)
  set(sbom ${CMAKE_BINARY_DIR}/romap.spdx.json)
  if(EXISTS ${sbom})  # the same contents keep their date
    file(READ ${sbom} old)
    if(old MATCHES "${digest}" AND old MATCHES "\"created\": \"([^\"]+)\"")
      set(now "${CMAKE_MATCH_1}")
    endif()
  endif()
  file(WRITE ${sbom} "{\"spdxVersion\": \"SPDX-2.3\", \"dataLicense\": \"CC0-1.0\", \"SPDXID\": \"SPDXRef-DOCUMENT\",
  \"name\": \"romap-${PROJECT_VERSION}\", \"documentNamespace\": \"https://spdx.org/spdxdocs/romap-${PROJECT_VERSION}-${digest}\",
  \"creationInfo\": {\"created\": \"${now}\", \"creators\": [\"Tool: romap-build\"]},
  \"packages\": [
    {\"SPDXID\": \"SPDXRef-romap\", \"name\": \"romap\", \"versionInfo\": \"${PROJECT_VERSION}\", \"downloadLocation\": \"NOASSERTION\",
     \"filesAnalyzed\": false, \"licenseConcluded\": \"Apache-2.0\", \"licenseDeclared\": \"Apache-2.0\", \"copyrightText\": \"NOASSERTION\"}${packages}],
  \"relationships\": [
    {\"spdxElementId\": \"SPDXRef-DOCUMENT\", \"relationshipType\": \"DESCRIBES\", \"relatedSpdxElement\": \"SPDXRef-romap\"}${described}]}
")
endfunction()
romap_write_libraries()

# The commit, written by every build, and only if it has changed. Only the two programs link it, so that a commit does
# not link all tests again.
add_custom_target(romap_commit BYPRODUCTS ${CMAKE_BINARY_DIR}/generated/commit.inc
  COMMAND ${CMAKE_COMMAND} -DSOURCE=${CMAKE_SOURCE_DIR} -DOUTPUT=${CMAKE_BINARY_DIR}/generated/commit.inc
          -P ${CMAKE_SOURCE_DIR}/deploy/cmake/WriteCommit.cmake)
