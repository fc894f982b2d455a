#include "server/session/outbox.h"

#include <utility>

namespace romap {
namespace {

const size_t kAck = MapEvent(FrameAck{}).index(), kObject = MapEvent(ObjectUpdate{}).index(),
             kMesh = MapEvent(MeshUpdate{}).index(), kStatistics = MapEvent(Statistics{}).index();

}  // namespace

void Outbox::Put(MapEvent event) {
  std::lock_guard lock(mutex_);
  if (closed_) return;
  if (auto* object = std::get_if<ObjectUpdate>(&event)) {
    Append({kObject, object->id.value}, std::move(event));
  } else if (auto* mesh = std::get_if<MeshUpdate>(&event)) {
    Append({kMesh, mesh->id.value}, std::move(event));
  } else if (std::holds_alternative<Statistics>(event)) {
    Append({kStatistics, 0}, std::move(event));
  } else if (std::holds_alternative<FrameAck>(event)) {
    if (acks_ == Acks::kNewest) {
      Append({kAck, 0}, std::move(event));
    } else {
      events_.push_back(std::move(event));
      ++waiting_acks_;
      TrimAcks();
    }
  } else {
    // What waits of an object that is gone would bring it back to life.
    const ObjectId gone = std::holds_alternative<ObjectRemoved>(event) ? std::get<ObjectRemoved>(event).id
                                                                       : std::get<ObjectMerged>(event).from;
    Forget({kObject, gone.value});
    Forget({kMesh, gone.value});
    events_.push_back(std::move(event));
  }
  ready_.notify_one();
}

void Outbox::Append(const Key& key, MapEvent event) {
  // The newer event goes to the end, not to the place of the older one, so that revisions arrive in their order.
  Forget(key);
  events_.push_back(std::move(event));
  waiting_[key] = std::prev(events_.end());
}

void Outbox::Forget(const Key& key) {
  if (const auto it = waiting_.find(key); it != waiting_.end()) {
    events_.erase(it->second);
    waiting_.erase(it);
  }
}

void Outbox::TrimAcks() {
  if (waiting_acks_ <= max_acks_) return;
  for (auto it = events_.begin(); it != events_.end(); ++it) {
    if (!std::holds_alternative<FrameAck>(*it)) continue;
    events_.erase(it);
    --waiting_acks_;
    return;
  }
}

std::optional<MapEvent> Outbox::Next(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  ready_.wait_for(lock, timeout, [&] { return closed_ || !events_.empty(); });
  if (events_.empty()) return std::nullopt;
  for (auto it = waiting_.begin(); it != waiting_.end(); ++it) {
    if (it->second == events_.begin()) {
      waiting_.erase(it);
      break;
    }
  }
  MapEvent event = std::move(events_.front());
  events_.pop_front();
  if (acks_ == Acks::kAll && std::holds_alternative<FrameAck>(event)) --waiting_acks_;
  return event;
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

}  // namespace romap
