#include <romap/client/sdk/remote_mapping_service.h>

#include <cstdio>

int main(int, char** argv) {
  auto server = romap::client::RemoteMappingService::Connect(argv[1]);
  if (!server.ok()) return std::fprintf(stderr, "%s\n", server.status().ToString().c_str()), 1;
  for (const romap::SessionInfo& session : (*server)->ListSessions().value()) {
    std::printf("%s: %zu objects\n", session.id.c_str(), (*server)->ExportMap(session.id).value().objects.size());
  }
}
