#include "server/session/outbox.h"

#include <algorithm>
#include <utility>
#include <variant>

namespace romap::session {
namespace {

bool IsAck(const MapEvent& event) {
  return std::holds_alternative<FrameAck>(event) || std::holds_alternative<MasksAck>(event);
}

}  // namespace

struct Outbox::Putter {
  Outbox& outbox;
  void operator()(FrameAck&& ack) const { outbox.PutAck(std::move(ack)); }
  void operator()(MasksAck&& ack) const { outbox.PutAck(std::move(ack)); }
  void operator()(ObjectUpdate&& update) const { outbox.PutUpdate(std::move(update)); }
  void operator()(MeshUpdate&& mesh) const { outbox.PutMesh(std::move(mesh)); }
  void operator()(ObjectRemoved&& removed) const { outbox.PutRemoved(std::move(removed)); }
  void operator()(ObjectMerged&& merged) const { outbox.PutMerged(merged); }
  void operator()(Statistics&& statistics) const { outbox.Replace(outbox.statistics_, statistics); }
};

void Outbox::Put(MapEvent event) {
  std::lock_guard lock(mutex_);
  if (closed_) return;
  std::visit(Putter{*this}, std::move(event));
  ready_.notify_one();
}

void Outbox::PutAck(MapEvent event) {
  if (acks_ == Acks::kNewest) {
    // A viewer follows the camera; what a client's masks came to is nothing to it.
    if (std::holds_alternative<FrameAck>(event)) Replace(newest_ack_, std::move(event));
    return;
  }
  Append(std::move(event));
  ++waiting_acks_;
  TrimAcks();
}

void Outbox::PutUpdate(ObjectUpdate update) {
  const auto [it, is_new] = known_.try_emplace(update.id);
  Known& object = it->second;
  object.revision = update.revision;
  if (is_new) {
    object.announcement = Append(std::move(update));
  } else {
    Replace(object.update, std::move(update));
  }
}

void Outbox::PutMesh(MeshUpdate mesh) {
  const auto it = known_.find(mesh.id);
  if (it == known_.end()) return;
  it->second.revision = mesh.revision;
  Replace(it->second.mesh, std::move(mesh));
}

void Outbox::PutRemoved(ObjectRemoved removed) {
  uint64_t last_revision = 0;
  if (ForgetObject(removed.id, &last_revision)) {
    Append(std::move(removed));
    return;
  }
  for (auto it = merges_.begin(); it != merges_.end();) {
    MapEvent& event = *it->second.place;
    if (std::get<ObjectMerged>(event).into != removed.id) {
      ++it;
      continue;
    }
    event = ObjectRemoved{.id = it->first, .revision = it->second.removal_revision, .reason = removed.reason};
    it = merges_.erase(it);
  }
}

void Outbox::PutMerged(ObjectMerged merged) {
  uint64_t last_revision = 0;
  if (ForgetObject(merged.from, &last_revision)) {
    merges_[merged.from] = {Append(merged), last_revision + 1};
    return;
  }
  for (auto& [from, merge] : merges_) {
    ObjectMerged& waiting = std::get<ObjectMerged>(*merge.place);
    if (waiting.into != merged.from) continue;
    waiting = {.from = from, .into = merged.into, .revision = merged.revision};
    events_.splice(events_.end(), events_, merge.place);  // behind the announcement of `into`
  }
}

bool Outbox::ForgetObject(ObjectId id, uint64_t* last_revision) {
  const auto it = known_.find(id);
  if (it == known_.end()) return false;
  Known& object = it->second;
  *last_revision = object.revision;
  const bool has_been_told = !object.announcement;
  Drop(object.announcement);
  Drop(object.update);
  Drop(object.mesh);
  known_.erase(it);
  return has_been_told;
}

Outbox::Place Outbox::Append(MapEvent event) {
  events_.push_back(std::move(event));
  return std::prev(events_.end());
}

// The newer event goes to the end, not to the place of the older one, so that revisions arrive in their order.
void Outbox::Replace(std::optional<Place>& place, MapEvent event) {
  Drop(place);
  place = Append(std::move(event));
}

void Outbox::Drop(std::optional<Place>& place) {
  if (place) events_.erase(*place);
  place.reset();
}

void Outbox::TrimAcks() {
  if (waiting_acks_ <= max_acks_) return;
  events_.erase(std::find_if(events_.begin(), events_.end(), IsAck));
  --waiting_acks_;
}

std::optional<MapEvent> Outbox::Next(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  ready_.wait_for(lock, timeout, [&] { return closed_ || !events_.empty(); });
  if (events_.empty()) return std::nullopt;
  ForgetFront();
  MapEvent event = std::move(events_.front());
  events_.pop_front();
  return event;
}

// The first event is about to be taken: no newer one can replace it any more.
void Outbox::ForgetFront() {
  const Place front = events_.begin();
  const auto forget = [&](std::optional<Place>& place) {
    if (place == front) place.reset();
  };
  if (const auto* update = std::get_if<ObjectUpdate>(&*front)) {
    Known& object = known_.at(update->id);
    forget(object.announcement);
    forget(object.update);
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&*front)) {
    forget(known_.at(mesh->id).mesh);
  } else if (const auto* merged = std::get_if<ObjectMerged>(&*front)) {
    merges_.erase(merged->from);
  } else if (IsAck(*front)) {
    forget(newest_ack_);
    if (acks_ == Acks::kAll) --waiting_acks_;
  } else {
    forget(statistics_);
  }
}

void Outbox::Close(absl::Status status) {
  std::lock_guard lock(mutex_);
  if (closed_) return;
  closed_ = true;
  status_ = std::move(status);
  ready_.notify_all();
}

bool Outbox::Done() const {
  std::lock_guard lock(mutex_);
  return closed_ && events_.empty();
}

absl::Status Outbox::status() const {
  std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace romap::session
