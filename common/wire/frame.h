#pragma once

#include <absl/status/statusor.h>

#include "common/client_input.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// Both directions take their argument by value and move the image, mask and depth bytes.

// Without checks: the receiver rejects invalid frames.
v1::Frame ToProto(FrameInput frame);
v1::LateMasks ToProto(MasksInput masks);

// INVALID_ARGUMENT "frame.<field>: ...": a required part is missing or empty, an enum value is unknown, a number is not
// finite or out of range, a quaternion is not a rotation, or an instance label is listed twice. Does not decode the
// image, masks and depth.
absl::StatusOr<FrameInput> FromProto(v1::Frame proto);
// As above, "late_masks.<field>: ...".
absl::StatusOr<MasksInput> FromProto(v1::LateMasks proto);

}  // namespace romap::wire
