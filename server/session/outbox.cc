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
  // Few: a session sends each code at most once per severity.
  void operator()(Diagnostic&& diagnostic) const { outbox.Append(std::move(diagnostic)); }
  void operator()(Statistics&& statistics) const { outbox.Replace(outbox.statistics_, statistics); }
  void operator()(Durable&& durable) const { outbox.Replace(outbox.durable_, durable); }
};

void Outbox::Put(MapEvent event) {
  std::lock_guard lock(mutex_);
  if (closed_) return;
  std::visit(Putter{*this}, std::move(event));
  ready_.notify_one();
}

void Outbox::PutAck(MapEvent event) {
  if (acks_ == Acks::kNewest) {
    if (std::holds_alternative<FrameAck>(event)) Replace(newest_ack_, std::move(event));
    return;
  }
  Append(std::move(event));
  ++waiting_acks_;
  TrimAcks();
}

void Outbox::PutUpdate(ObjectUpdate update) {
  const auto [it, is_new] = objects_.try_emplace(update.id);
  AnnouncedObject& object = it->second;
  object.revision = update.revision;
  if (is_new) {
    object.announcement = Append(std::move(update));
  } else {
    Replace(object.update, std::move(update));
  }
}

void Outbox::PutMesh(MeshUpdate mesh) {
  const auto it = objects_.find(mesh.id);
  if (it == objects_.end()) return;
  it->second.revision = mesh.revision;
  Replace(it->second.mesh, std::move(mesh));
}

void Outbox::PutRemoved(ObjectRemoved removed) {
  uint64_t last_revision = 0;
  if (DropObject(removed.id, &last_revision)) {
    Append(std::move(removed));
    return;
  }
  for (auto it = merges_.begin(); it != merges_.end();) {
    MapEvent& event = *it->second.event;
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
  if (DropObject(merged.from, &last_revision)) {
    merges_[merged.from] = {Append(merged), last_revision + 1};
    return;
  }
  for (auto& [from, merge] : merges_) {
    ObjectMerged& waiting = std::get<ObjectMerged>(*merge.event);
    if (waiting.into != merged.from) continue;
    waiting = {.from = from, .into = merged.into, .revision = merged.revision};
    events_.splice(events_.end(), events_, merge.event);  // behind the announcement of the new `into`
  }
}

bool Outbox::DropObject(ObjectId id, uint64_t* last_revision) {
  const auto it = objects_.find(id);
  if (it == objects_.end()) return false;
  AnnouncedObject& object = it->second;
  *last_revision = object.revision;
  const bool was_announced = !object.announcement;
  Drop(object.announcement);
  Drop(object.update);
  Drop(object.mesh);
  objects_.erase(it);
  return was_announced;
}

Outbox::EventIterator Outbox::Append(MapEvent event) {
  events_.push_back(std::move(event));
  return std::prev(events_.end());
}

// The new event goes to the end instead of the position of the old one, so that revisions are read in order.
void Outbox::Replace(std::optional<EventIterator>& old_event, MapEvent event) {
  Drop(old_event);
  old_event = Append(std::move(event));
}

void Outbox::Drop(std::optional<EventIterator>& event) {
  if (event) events_.erase(*event);
  event.reset();
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
  ClearIteratorsToFront();
  MapEvent event = std::move(events_.front());
  events_.pop_front();
  return event;
}

// The first event is about to be returned, so a newer one can no longer replace it.
void Outbox::ClearIteratorsToFront() {
  const EventIterator front = events_.begin();
  const auto clear = [&](std::optional<EventIterator>& event) {
    if (event == front) event.reset();
  };
  if (const auto* update = std::get_if<ObjectUpdate>(&*front)) {
    AnnouncedObject& object = objects_.at(update->id);
    clear(object.announcement);
    clear(object.update);
  } else if (const auto* mesh = std::get_if<MeshUpdate>(&*front)) {
    clear(objects_.at(mesh->id).mesh);
  } else if (const auto* merged = std::get_if<ObjectMerged>(&*front)) {
    merges_.erase(merged->from);
  } else if (IsAck(*front)) {
    clear(newest_ack_);
    if (acks_ == Acks::kAll) --waiting_acks_;
  } else {
    clear(statistics_);
    clear(durable_);
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
