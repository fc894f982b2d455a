#pragma once

#include <absl/status/statusor.h>

#include "common/client_input.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// Both directions take their argument by value and move the image, mask and depth bytes instead of copying them.

// Nothing is checked here: the receiver answers a bad frame.
v1::Frame ToProto(FrameInput frame);
v1::LateMasks ToProto(MasksInput masks);

// INVALID_ARGUMENT "frame.<field>: ..." for what the wire can break: a part that is missing or empty, an unknown enum
// value, a number that is not finite or out of its range, a rotation that is none, an instance's label given twice.
// Whether the bytes decode to images of the right size is not looked at.
absl::StatusOr<FrameInput> FromProto(v1::Frame proto);
// As above, "late_masks.<field>: ...".
absl::StatusOr<MasksInput> FromProto(v1::LateMasks proto);

}  // namespace romap::wire
