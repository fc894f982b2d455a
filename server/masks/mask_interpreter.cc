#include "server/masks/mask_interpreter.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "common/label_image.h"
#include "server/masks/mask_evidence.h"
#include "server/masks/surface_names.h"

namespace romap::masks {
namespace {

constexpr uint16_t kVoidLabel = 255;         // "ignore" in the 8-bit masks of the public segmentation sets
constexpr const char* kAnyClass = "object";  // of instances without a class

constexpr int kMinFrames = 4;             // before a mask becomes background; fewer than a confirmation requires
constexpr double kBackgroundShare = 0.6;  // of its frames in which a mask looks like background
constexpr double kObjectShare = 0.3;      // below it, a mask is not background any more
constexpr double kFollowIou = 0.4;        // of a mask in two frames

// A mask without background.
constexpr double kFewBackground = 0.02;  // of the pixels
constexpr double kMuchUnknown = 0.2;
constexpr uint64_t kMinFramesWithoutBackground = 10;

// A client may send a new class name with every mask.
constexpr size_t kMaxClasses = 1000;
constexpr size_t kMaxNamedClasses = 5;  // in the text of a diagnostic

constexpr size_t kMaxWaiting = 100;  // frames whose masks may follow late

const Instance* FindInstance(const std::vector<Instance>& instances, uint16_t label) {
  const auto found =
      std::find_if(instances.begin(), instances.end(), [&](const Instance& i) { return i.label == label; });
  return found == instances.end() ? nullptr : &*found;
}

// The box in pixels of the frame.
cv::Rect FullBox(const MaskThumbnail& thumbnail, const cv::Rect& box, const cv::Size& size) {
  const int stride = thumbnail.stride_px;
  return cv::Rect(box.x * stride, box.y * stride, box.width * stride, box.height * stride) & cv::Rect({}, size);
}

}  // namespace

void MaskInterpreter::Interpret(bool eight_bit, Frame* frame) {
  const cv::Mat gray = MakeGray(frame->image_bgr);
  image_check_.AddImage(frame->frame_id, frame->timestamp_ns, gray);
  if (!frame->has_masks) {
    waiting_.emplace_back(frame->frame_id, gray);
    if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
    return;
  }
  frame->non_objects = InterpretLabels(frame->frame_id, gray, eight_bit, &frame->labels, &frame->instances);
}

void MaskInterpreter::Interpret(bool eight_bit, FrameMasks* masks) {
  const auto found =
      std::find_if(waiting_.begin(), waiting_.end(), [&](const auto& frame) { return frame.first == masks->frame_id; });
  const cv::Mat gray = found == waiting_.end() ? cv::Mat() : found->second;
  masks->non_objects = InterpretLabels(masks->frame_id, gray, eight_bit, &masks->labels, &masks->instances);
}

std::vector<NonObjectMask> MaskInterpreter::InterpretLabels(uint64_t frame_id, const cv::Mat& gray, bool eight_bit,
                                                            cv::Mat* labels, std::vector<Instance>* instances) {
  if (eight_bit) IgnoreVoid(frame_id, labels, instances);
  std::erase_if(*instances, [](const Instance& instance) { return instance.label == kIgnoreLabel; });
  MaskThumbnail thumbnail = MakeThumbnail(*labels, gray);
  image_check_.AddMasks(frame_id, thumbnail);
  CountBackground(frame_id, thumbnail);
  std::vector<FollowedMask> masks = Follow(thumbnail, *instances);
  for (FollowedMask& mask : masks) Decide(frame_id, thumbnail, &mask);
  const SceneMotion::CameraFixed fixed = scene_motion_.Find(thumbnail);
  for (const uint16_t label : fixed.labels) {
    const auto mask = std::find_if(masks.begin(), masks.end(), [&](const auto& m) { return m.label == label; });
    if (mask != masks.end() && mask->may_move_with_camera) mask->role = Role::kCameraFixed;
  }
  std::vector<NonObjectMask> non_objects;
  for (const FollowedMask& mask : masks) {
    if (mask.role == Role::kObject) continue;
    const bool is_background = mask.role == Role::kBackground;
    if (!is_background) {
      Note(frame_id, {.code = "mask_moves_with_camera",
                      .text = "keep their place in the image while the scene moves: they are no object, and what they "
                              "hide is not known",
                      .classes = {mask.class_name}});
    }
    labels->setTo(is_background ? uint16_t{0} : kIgnoreLabel, *labels == mask.label);
    std::erase_if(*instances, [&](const Instance& instance) { return instance.label == mask.label; });
    non_objects.push_back({.box_px = FullBox(thumbnail, thumbnail.Find(mask.label)->box, labels->size()),
                           .class_name = mask.class_name,
                           .reason = is_background ? "its masks show background" : "it moves with the camera"});
  }
  if (!fixed.region.empty()) IgnoreRegion(frame_id, thumbnail, fixed.region, labels);
  previous_ = std::move(thumbnail);
  followed_ = std::move(masks);
  return non_objects;
}

// Masks with the values 0 and 255 alone are masks of one object. Where other labels occur, 255 means "ignore".
void MaskInterpreter::IgnoreVoid(uint64_t frame_id, cv::Mat* labels, std::vector<Instance>* instances) {
  const Instance* instance = FindInstance(*instances, kVoidLabel);
  if (instance != nullptr && instance->class_name != kAnyClass) return;  // the client says what it is
  const cv::Mat is_void = *labels == kVoidLabel;
  if (cv::countNonZero(is_void) == 0) return;
  void_is_ignored_ |= cv::countNonZero(*labels) > cv::countNonZero(is_void);
  if (!void_is_ignored_) return;
  labels->setTo(kIgnoreLabel, is_void);
  std::erase_if(*instances, [](const Instance& i) { return i.label == kVoidLabel; });
  Note(frame_id, {.code = "mask_value_255_ignored",
                  .text = "the value 255 of 8-bit masks is read as \"ignore\": it is neither an object nor background",
                  .advice = "if it is an object, list it among the instances with its class"});
}

// The part of the image without a mask is not background there: it hides what is behind it.
void MaskInterpreter::IgnoreRegion(uint64_t frame_id, const MaskThumbnail& thumbnail, const cv::Mat& region,
                                   cv::Mat* labels) {
  const int stride = thumbnail.stride_px;
  cv::Mat enlarged;
  cv::resize(region, enlarged, cv::Size(stride * region.cols, stride * region.rows), 0, 0, cv::INTER_NEAREST);
  const cv::Mat selected = enlarged(cv::Rect({}, labels->size())) & (*labels == 0);
  labels->setTo(kIgnoreLabel, selected);
  const int ignored = cv::countNonZero(selected);
  constexpr double kNoteworthy = 0.003;  // of the image; less is the border of a mask that moves with the camera
  if (ignored < kNoteworthy * static_cast<double>(labels->total())) return;
  Note(frame_id,
       {.code = "image_part_moves_with_camera",
        .text = fmt::format("a part of the image ({:.0f} % in frame {}) keeps its place while the scene moves: "
                            "what it hides is not known",
                            100.0 * ignored / static_cast<double>(labels->total()), frame_id)});
}

std::vector<MaskInterpreter::FollowedMask> MaskInterpreter::Follow(const MaskThumbnail& thumbnail,
                                                                   const std::vector<Instance>& instances) {
  std::vector<FollowedMask> masks;
  std::set<uint16_t> taken;  // labels of `previous_`
  for (const MaskRegion& region : thumbnail.regions) {
    const Instance* instance = FindInstance(instances, region.label);
    const std::string class_name = instance != nullptr ? instance->class_name : kAnyClass;
    const FollowedMask* best = nullptr;
    double best_iou = kFollowIou;
    for (const FollowedMask& candidate : followed_) {
      const MaskRegion* before = previous_.Find(candidate.label);
      if (taken.contains(candidate.label) || candidate.class_name != class_name) continue;
      if ((before->box & region.box).empty()) continue;
      const double iou = MaskIou(previous_, candidate.label, thumbnail, region.label);
      if (iou <= best_iou) continue;
      best_iou = iou;
      best = &candidate;
    }
    masks.push_back(best != nullptr ? *best : Begin(region.label, class_name));
    if (best != nullptr) taken.insert(best->label);
    masks.back().label = region.label;
  }
  return masks;
}

// A new mask of a class whose masks show background starts with that evidence.
MaskInterpreter::FollowedMask MaskInterpreter::Begin(uint16_t label, const std::string& class_name) const {
  FollowedMask mask{.label = label, .class_name = class_name};
  const auto known = classes_.find(class_name);
  if (known == classes_.end() || known->second.masks < kMinFrames) return mask;
  mask.frames = kMinFrames;
  mask.like_background = kMinFrames * known->second.like_background / known->second.masks;
  return mask;
}

void MaskInterpreter::Decide(uint64_t frame_id, const MaskThumbnail& thumbnail, FollowedMask* mask) {
  const BackgroundSign sign = FindBackgroundSign(thumbnail, *thumbnail.Find(mask->label), mask->class_name);
  const int like_background = sign != BackgroundSign::kNone ? 1 : 0;
  // A table that fills the image keeps its place too. The hood of a rover only extends beyond its sides.
  mask->may_move_with_camera = sign == BackgroundSign::kNone || sign == BackgroundSign::kCrossesBorders;
  ++mask->frames;
  mask->like_background += like_background;
  if (mask->class_name != kAnyClass && (classes_.size() < kMaxClasses || classes_.contains(mask->class_name))) {
    ClassEvidence& evidence = classes_[mask->class_name];
    ++evidence.masks;
    evidence.like_background += like_background;
  }
  if (mask->role == Role::kCameraFixed) return;
  const double share = static_cast<double>(mask->like_background) / mask->frames;
  if (mask->role == Role::kBackground && share < kObjectShare) mask->role = Role::kObject;
  if (mask->role == Role::kObject && mask->frames >= kMinFrames && share >= kBackgroundShare) {
    mask->role = Role::kBackground;
    // The name of a surface agrees with the evidence; any other name contradicts it.
    const bool is_surface = IsSurfaceName(mask->class_name);
    Note(frame_id, {.code = "mask_is_background",
                    .severity = is_surface ? Severity::kInfo : Severity::kWarning,
                    .text = "are read as background, because they fill most of the image, extend beyond most of its "
                            "sides, or surround the other masks",
                    .advice = is_surface ? "" : "if they show an object, record it from further away",
                    .classes = {mask->class_name}});
  }
}

void MaskInterpreter::CountBackground(uint64_t frame_id, const MaskThumbnail& thumbnail) {
  ++mask_frames_;
  const int background = cv::countNonZero(thumbnail.labels == 0);
  const int unknown = cv::countNonZero(thumbnail.labels == kIgnoreLabel);
  if (background > kFewBackground * thumbnail.pixels() || unknown < kMuchUnknown * thumbnail.pixels()) return;
  if (frames_without_background_++ == 0) first_frame_without_background_ = frame_id;
}

std::optional<Diagnostic> MaskInterpreter::MissingBackground() const {
  if (frames_without_background_ < kMinFramesWithoutBackground || 2 * frames_without_background_ < mask_frames_) {
    return std::nullopt;
  }
  return Diagnostic{.code = "masks_without_background",
                    .severity = Severity::kWarning,
                    .first_frame_id = first_frame_without_background_,
                    .count = frames_without_background_,
                    .text =
                        "the masks have no background: nearly all pixels outside the objects are unknown (65535, or "
                        "255 in 8-bit masks), so nothing bounds the shapes of the objects",
                    .advice = "give pixels that show no object the label 0"};
}

void MaskInterpreter::Note(uint64_t frame_id, const Finding& finding) {
  const auto [it, is_new] = findings_.try_emplace(finding.code, finding);
  Finding& known = it->second;
  if (is_new) known.first_frame_id = frame_id;
  ++known.count;
  known.severity = std::max(known.severity, finding.severity);
  if (known.advice.empty()) known.advice = finding.advice;
  for (const std::string& name : finding.classes) {
    if (known.classes.size() < kMaxNamedClasses) known.classes.insert(name);
    known.has_more_classes |= !known.classes.contains(name);
  }
}

std::vector<Diagnostic> MaskInterpreter::Diagnostics() const {
  std::vector<Diagnostic> diagnostics;
  for (const auto& [code, finding] : findings_) {
    std::string text;
    for (const std::string& name : finding.classes) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", name);
    if (!text.empty()) text = "masks of class " + text + (finding.has_more_classes ? " and others " : " ");
    diagnostics.push_back({.code = code,
                           .severity = finding.severity,
                           .first_frame_id = finding.first_frame_id,
                           .count = finding.count,
                           .text = text + finding.text,
                           .advice = finding.advice});
  }
  if (const auto missing = MissingBackground()) diagnostics.push_back(*missing);
  if (const auto contradiction = image_check_.Check()) diagnostics.push_back(*contradiction);
  return diagnostics;
}

}  // namespace romap::masks
