#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/generated_enum_reflection.h>

#include <array>
#include <string>

#include "common/client_input.h"
#include "common/map_events.h"
#include "common/mapping_service.h"
#include "common/status.h"
#include "romap/v1/mapping.pb.h"

namespace romap::wire {

// One table per enum is used for both directions, which keeps them consistent.
template <class Plain, class Wire>
struct EnumPair {
  Plain plain;
  Wire wire;
};

inline constexpr std::array<EnumPair<ImageEncoding, v1::ImageEncoding>, 5> kImageEncodings{{
    {ImageEncoding::kJpeg, v1::IMAGE_ENCODING_JPEG},
    {ImageEncoding::kPng, v1::IMAGE_ENCODING_PNG},
    {ImageEncoding::kRawRgb8, v1::IMAGE_ENCODING_RAW_RGB8},
    {ImageEncoding::kRawBgr8, v1::IMAGE_ENCODING_RAW_BGR8},
    {ImageEncoding::kRawGray8, v1::IMAGE_ENCODING_RAW_GRAY8},
}};

inline constexpr std::array<EnumPair<DepthEncoding, v1::DepthEncoding>, 2> kDepthEncodings{{
    {DepthEncoding::kPng16, v1::DEPTH_ENCODING_PNG16},
    {DepthEncoding::kRawUint16, v1::DEPTH_ENCODING_RAW_UINT16},
}};

// LENS_MODEL_UNSPECIFIED is accepted as radial-tangential, the only lens of older clients.
inline constexpr std::array<EnumPair<LensModel, v1::LensModel>, 3> kLensModels{{
    {LensModel::kRadialTangential, v1::LENS_MODEL_RADIAL_TANGENTIAL},
    {LensModel::kRadialTangential, v1::LENS_MODEL_UNSPECIFIED},
    {LensModel::kFisheye, v1::LENS_MODEL_FISHEYE},
}};

// FRAME_MODE_UNSPECIFIED is accepted as replay.
inline constexpr std::array<EnumPair<FrameMode, v1::FrameMode>, 3> kFrameModes{{
    {FrameMode::kReplay, v1::FRAME_MODE_REPLAY},
    {FrameMode::kReplay, v1::FRAME_MODE_UNSPECIFIED},
    {FrameMode::kLive, v1::FRAME_MODE_LIVE},
}};

// POSE_USE_UNSPECIFIED is accepted as given, the only use in older clients.
inline constexpr std::array<EnumPair<PoseUse, v1::PoseUse>, 4> kPoseUses{{
    {PoseUse::kGiven, v1::POSE_USE_GIVEN},
    {PoseUse::kGiven, v1::POSE_USE_UNSPECIFIED},
    {PoseUse::kPrior, v1::POSE_USE_PRIOR},
    {PoseUse::kIgnore, v1::POSE_USE_IGNORE},
}};

inline constexpr std::array<EnumPair<SessionState, v1::SessionState>, 5> kSessionStates{{
    {SessionState::kOpen, v1::SESSION_STATE_OPEN},
    {SessionState::kFinishing, v1::SESSION_STATE_FINISHING},
    {SessionState::kFinished, v1::SESSION_STATE_FINISHED},
    {SessionState::kFailed, v1::SESSION_STATE_FAILED},
    {SessionState::kRestoring, v1::SESSION_STATE_RESTORING},
}};

inline constexpr std::array<EnumPair<TrackingState, v1::TrackingState>, 4> kTrackingStates{{
    {TrackingState::kInitializing, v1::TRACKING_STATE_INITIALIZING},
    {TrackingState::kTracking, v1::TRACKING_STATE_TRACKING},
    {TrackingState::kLost, v1::TRACKING_STATE_LOST},
    {TrackingState::kRelocalized, v1::TRACKING_STATE_RELOCALIZED},
}};

inline constexpr std::array<EnumPair<ObjectState, v1::ObjectState>, 3> kObjectStates{{
    {ObjectState::kProvisional, v1::OBJECT_STATE_PROVISIONAL},
    {ObjectState::kConfirmed, v1::OBJECT_STATE_CONFIRMED},
    {ObjectState::kLost, v1::OBJECT_STATE_LOST},
}};

// SEVERITY_UNSPECIFIED is accepted as a warning, the only one of older servers.
inline constexpr std::array<EnumPair<Severity, v1::Severity>, 4> kSeverities{{
    {Severity::kInfo, v1::SEVERITY_INFO},
    {Severity::kWarning, v1::SEVERITY_WARNING},
    {Severity::kWarning, v1::SEVERITY_UNSPECIFIED},
    {Severity::kError, v1::SEVERITY_ERROR},
}};

// The wire value; 0 (unspecified) for a value that is not in the table.
template <class Plain, class Wire, size_t N>
Wire EnumToProto(const std::array<EnumPair<Plain, Wire>, N>& table, Plain plain) {
  for (const auto& pair : table) {
    if (pair.plain == plain) return pair.wire;
  }
  return Wire{};
}

// INVALID_ARGUMENT, with `where` and the known values in the message.
template <class Plain, class Wire, size_t N>
absl::StatusOr<Plain> EnumFromProto(const std::array<EnumPair<Plain, Wire>, N>& table, Wire wire,
                                    const std::string& where) {
  std::string known;
  for (const auto& pair : table) {
    if (pair.wire == wire) return pair.plain;
    const auto* value = google::protobuf::GetEnumDescriptor<Wire>()->FindValueByNumber(static_cast<int>(pair.wire));
    known += (known.empty() ? "" : ", ") + value->name();
  }
  return InvalidArgument("{}: must be one of {}; is {}", where, known, static_cast<int>(wire));
}

}  // namespace romap::wire
