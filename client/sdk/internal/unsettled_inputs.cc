#include "client/sdk/internal/unsettled_inputs.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <variant>

namespace romap::client {
namespace {

size_t BytesOfMasks(const EncodedMasks& masks) {
  size_t bytes = masks.label_png.size() + masks.label_runs.size() * sizeof(uint32_t);
  for (const Instance& instance : masks.instances) bytes += sizeof(Instance) + instance.class_name.size();
  return bytes;
}

}  // namespace

size_t UnsettledInputs::BytesOf(const SessionInput& input) {
  if (const auto* masks = std::get_if<MasksInput>(&input)) return sizeof(MasksInput) + BytesOfMasks(*masks);
  const FrameInput& frame = std::get<FrameInput>(input);
  return sizeof(FrameInput) + BytesOfMasks(frame) + frame.image.size() + frame.depth.size();
}

void UnsettledInputs::Add(SessionInput input, Clock::time_point now) {
  Item item;
  item.is_masks = std::holds_alternative<MasksInput>(input);
  item.frame_id = item.is_masks ? std::get<MasksInput>(input).frame_id : std::get<FrameInput>(input).frame_id;
  item.bytes = BytesOf(input);
  item.added = now;
  item.input = std::make_shared<const SessionInput>(std::move(input));
  bytes_ += item.bytes;
  items_.emplace(added_++, std::move(item));
}

std::optional<UnsettledInputs::Outgoing> UnsettledInputs::TakeNext() {
  const auto it = items_.lower_bound(next_);
  if (it == items_.end()) return std::nullopt;
  next_ = it->first + 1;
  Item& item = it->second;
  const bool resent = std::exchange(item.sent, true) || item.waited;
  item.sent_on_stream = true;
  return Outgoing{item.input, resent};
}

void UnsettledInputs::BeginStream(bool durable) {
  durable_ = durable;
  next_ = 0;
  for (auto it = items_.begin(); it != items_.end();) {
    it->second.sent_on_stream = it->second.answered = false;
    it->second.waited = !is_first_;
    it = IsSettled(it->second) ? Erase(it) : std::next(it);
  }
  is_first_ = false;
}

template <class Ack>
void UnsettledInputs::AcknowledgeAny(const Ack& ack, bool is_masks, std::vector<MapEvent>* deliver) {
  const auto it = Find(is_masks, ack.frame_id);
  if (it == items_.end()) return;  // settled: the caller has had the acknowledgement
  Item& item = it->second;
  if (ack.accepted && item.sent_on_stream) AcknowledgeBefore<Ack>(it->first, is_masks, deliver);
  item.answered = true;
  if (!std::exchange(item.acked, true)) deliver->emplace_back(ack);
  if (!ack.accepted || IsSettled(item)) Erase(it);
}

template <class Ack>
void UnsettledInputs::AcknowledgeBefore(uint64_t sequence, bool is_masks, std::vector<MapEvent>* deliver) {
  for (auto it = items_.begin(); it != items_.end() && it->first < sequence;) {
    Item& item = it->second;
    if (item.is_masks != is_masks || !item.sent_on_stream) {
      ++it;
      continue;
    }
    item.answered = true;
    if (!std::exchange(item.acked, true)) {
      Ack ack;
      ack.frame_id = item.frame_id;
      ack.duplicate = true;
      deliver->emplace_back(std::move(ack));
    }
    it = IsSettled(item) ? Erase(it) : std::next(it);
  }
}

template void UnsettledInputs::AcknowledgeAny(const FrameAck&, bool, std::vector<MapEvent>*);
template void UnsettledInputs::AcknowledgeAny(const MasksAck&, bool, std::vector<MapEvent>*);

UnsettledInputs::Items::iterator UnsettledInputs::Find(bool is_masks, uint64_t frame_id) {
  auto found = items_.end();
  for (auto it = items_.begin(); it != items_.end(); ++it) {
    if (it->second.is_masks != is_masks || it->second.frame_id != frame_id || !it->second.sent) continue;
    if (!it->second.acked) return it;
    if (found == items_.end()) found = it;
  }
  return found;
}

void UnsettledInputs::Cover(const Durable& durable) {
  for (auto it = items_.begin(); it != items_.end();) {
    Item& item = it->second;
    const uint64_t newest = item.is_masks ? durable.masks_frame_id : durable.frame_id;
    // What was never sent cannot be stored, whatever its id.
    item.covered = item.covered || (item.sent && item.frame_id <= newest);
    it = IsSettled(item) ? Erase(it) : std::next(it);
  }
}

std::optional<uint64_t> UnsettledInputs::DropOldestUnsentFrame() {
  for (auto it = items_.lower_bound(next_); it != items_.end(); ++it) {
    if (it->second.sent || it->second.is_masks) continue;
    const uint64_t frame_id = it->second.frame_id;
    Erase(it);
    return frame_id;
  }
  return std::nullopt;
}

std::vector<uint64_t> UnsettledInputs::DropUnsentFrames(Clock::time_point time) {
  std::vector<uint64_t> dropped;
  for (auto it = items_.lower_bound(next_); it != items_.end() && it->second.added < time;) {
    if (it->second.sent || it->second.is_masks) {
      ++it;
      continue;
    }
    dropped.push_back(it->second.frame_id);
    it = Erase(it);
  }
  return dropped;
}

void UnsettledInputs::Clear() {
  items_.clear();
  bytes_ = 0;
}

size_t UnsettledInputs::Waiting() const {
  return static_cast<size_t>(std::distance(items_.lower_bound(next_), items_.end()));
}

bool UnsettledInputs::AllAnswered() const {
  return std::all_of(items_.begin(), items_.end(), [](const auto& entry) { return entry.second.answered; });
}

size_t UnsettledInputs::Unacknowledged() const {
  return static_cast<size_t>(
      std::count_if(items_.begin(), items_.end(), [](const auto& entry) { return !entry.second.acked; }));
}

std::optional<uint64_t> UnsettledInputs::NewestFrameId() const {
  std::optional<uint64_t> newest;
  for (const auto& [sequence, item] : items_) {
    if (!item.is_masks && (!newest || item.frame_id > *newest)) newest = item.frame_id;
  }
  return newest;
}

UnsettledInputs::Items::iterator UnsettledInputs::Erase(Items::iterator item) {
  bytes_ -= item->second.bytes;
  return items_.erase(item);
}

}  // namespace romap::client
