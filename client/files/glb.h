#pragma once

#include <string>

#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// A mesh as one binary glTF 2.0 file (Khronos 2021) that any viewer opens. Positions stay as they are; a node rotation
// turns our z up into glTF's y up. Colours become linear, as glTF wants them (normalised 16 bit, since 8 linear bits
// show bands). A mesh without triangles becomes points. INVALID_ARGUMENT: a mesh that is not whole (see ValidateMesh),
// normals or colours of another length.
absl::StatusOr<std::string> EncodeGlb(const Mesh& mesh, const std::string& name);

// EncodeGlb to a file.
absl::Status WriteGlb(const std::string& path, const Mesh& mesh, const std::string& name = "object");

}  // namespace romap::files
