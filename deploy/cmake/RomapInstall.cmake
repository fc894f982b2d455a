# The files that `cmake --install` installs and `cpack` packages. Three components: server, client, dev (the client
# SDK).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

install(TARGETS romap-server RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT server)
install(FILES deploy/server.yaml DESTINATION ${CMAKE_INSTALL_DATADIR}/romap COMPONENT server)
install(FILES ${CMAKE_BINARY_DIR}/romap.spdx.json DESTINATION ${CMAKE_INSTALL_DOCDIR}-server COMPONENT server)
install(FILES deploy/systemd/romap-server.service DESTINATION lib/systemd/system COMPONENT server)
install(TARGETS romap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT client)

# The SDK. Its headers include each other as "common/..." and "client/sdk/...", so they are installed as a separate tree
# below include/romap.
set_target_properties(romap_sdk PROPERTIES EXPORT_NAME client)
install(TARGETS romap_sdk romap_wire romap_common romap_opencv romap_proto EXPORT romapTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/romap COMPONENT dev
        INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} ${CMAKE_INSTALL_INCLUDEDIR}/romap)
file(GLOB sdk_headers CONFIGURE_DEPENDS client/sdk/*.h)
install(FILES ${sdk_headers} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/romap/client/sdk COMPONENT dev)
foreach(header camera_model client_input cuboid diagnostic geometry ids map_events mapping_service mesh mesh_codec
        pose_uncertainty)
  install(FILES common/${header}.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/romap/common COMPONENT dev)
endforeach()
install(DIRECTORY proto/romap DESTINATION ${CMAKE_INSTALL_DATADIR}/romap/proto COMPONENT dev
        FILES_MATCHING PATTERN "*.proto")

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/romap)
install(EXPORT romapTargets NAMESPACE romap:: DESTINATION ${package_dir} COMPONENT dev)
file(WRITE ${CMAKE_BINARY_DIR}/romapConfig.cmake [[
include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(Protobuf)
find_dependency(gRPC CONFIG)
find_dependency(absl CONFIG)
find_dependency(Eigen3 CONFIG)
find_dependency(OpenCV CONFIG COMPONENTS core imgproc imgcodecs features2d calib3d)
find_dependency(spdlog CONFIG)
find_dependency(fmt CONFIG)
find_dependency(yaml-cpp CONFIG)
find_dependency(draco CONFIG)
find_dependency(JPEG)
find_dependency(PNG)
include(${CMAKE_CURRENT_LIST_DIR}/romapTargets.cmake)
]])
write_basic_package_version_file(${CMAKE_BINARY_DIR}/romapConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/romapConfig.cmake ${CMAKE_BINARY_DIR}/romapConfigVersion.cmake
        DESTINATION ${package_dir} COMPONENT dev)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME romap)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "romap maintainers <romap@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "live map of objects from a video with instance masks")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL server client dev)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_SERVER_PACKAGE_NAME romap-server)
set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME romap)
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libromap-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_SERVER_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "libgrpc++-dev, libprotobuf-dev, libabsl-dev, libeigen3-dev, libopencv-dev, libspdlog-dev, libfmt-dev, libyaml-cpp-dev, libdraco-dev, libjpeg62-turbo-dev, libpng-dev")
set(CPACK_COMPONENT_SERVER_DESCRIPTION "The server: tracks the camera, maps objects, trains their fields.")
set(CPACK_COMPONENT_CLIENT_DESCRIPTION "The command line client for recorded sequences.")
set(CPACK_COMPONENT_DEV_DESCRIPTION "The C++ client library, the protocol and the CMake package.")
include(CPack)
