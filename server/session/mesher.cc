#include "server/session/mesher.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "common/log_context.h"
#include "common/status.h"
#include "common/thread_priority.h"
#include "server/session/mesh_encoding.h"

namespace romap::session {

Mesher::Mesher(const mesh::MeshConfig& config, Threading threading, Waits waits)
    : config_(config), threading_(threading), waits_(waits) {
  if (threading == Threading::kOwnThread) thread_ = std::thread([this] { Run(); });
}

Mesher::~Mesher() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

Mesher::SessionId Mesher::AddSession(Sink sink, const std::string& session_id) {
  std::lock_guard lock(mutex_);
  const SessionId session = next_session_++;
  receivers_[session] = {std::move(sink), session_id};
  return session;
}

void Mesher::RemoveSession(SessionId session) {
  std::unique_lock lock(mutex_);
  receivers_.erase(session);
  last_offer_.erase(session);
  std::erase_if(waiting_, [&](const auto& entry) { return entry.first.first == session; });
  changed_.wait(lock, [&] { return busy_session_ != session; });
}

void Mesher::Offer(SessionId session, FieldSnapshot snapshot) {
  std::unique_lock lock(mutex_);
  if (!receivers_.contains(session)) return;
  if (threading_ == Threading::kCaller) {
    const Receiver receiver = receivers_.at(session);
    lock.unlock();
    MakeMesh(receiver, snapshot);
    return;
  }
  WaitingSnapshot& slot = waiting_[{session, snapshot.object}];
  last_offer_[session] = Clock::now();
  if (slot.ticket == 0) {
    slot.ticket = next_ticket_++;
    slot.since = Clock::now();
  }
  slot.snapshot = std::move(snapshot);
  changed_.notify_all();
}

void Mesher::RemoveObject(SessionId session, ObjectId object) {
  std::lock_guard lock(mutex_);
  waiting_.erase({session, object});
}

bool Mesher::IsIdle(SessionId session) const {
  std::lock_guard lock(mutex_);
  return busy_session_ != session && std::none_of(waiting_.begin(), waiting_.end(),
                                                  [&](const auto& entry) { return entry.first.first == session; });
}

void Mesher::MakeMesh(const Receiver& receiver, const FieldSnapshot& snapshot) const {
  const LogContext context(receiver.session_id);
  try {
    if (auto mesh = MakeMeshUpdate(snapshot, config_); mesh.ok()) {
      receiver.sink(*std::move(mesh), {snapshot.T_world_object, snapshot.S_new_first});
    } else {
      // Normal early in training, when the field has no surface yet. A later snapshot will have one.
      spdlog::debug("{}: no mesh after {} steps: {}", snapshot.object.ToString(), snapshot.steps,
                    Message(mesh.status()));
    }
  } catch (const std::exception& e) {  // from a library, or out of memory: only this mesh is lost
    spdlog::error("{}: meshing failed: {}", snapshot.object.ToString(), e.what());
  }
}

// When a waiting snapshot may be meshed.
Mesher::Clock::time_point Mesher::DueTime(const Waiting::value_type& entry) const {
  const WaitingSnapshot& waiting = entry.second;
  if (!waiting.snapshot.converged || !config_.texture) return waiting.since;
  return std::min(last_offer_.at(entry.first.first) + waits_.quiet, waiting.since + waits_.longest);
}

// Meshes without a texture are due at once. `waiting_` must not be empty.
Mesher::Waiting::iterator Mesher::FirstDue() {
  const Clock::time_point now = Clock::now();
  return std::min_element(waiting_.begin(), waiting_.end(), [&](const auto& a, const auto& b) {
    const Clock::time_point due_a = std::max(now, DueTime(a)), due_b = std::max(now, DueTime(b));
    return due_a != due_b ? due_a < due_b : a.second.ticket < b.second.ticket;
  });
}

void Mesher::Run() {
  LowerThreadPriority(kTrainingNice);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !waiting_.empty(); });
    if (stopping_) return;
    const auto oldest = FirstDue();
    if (const Clock::time_point due = DueTime(*oldest); due > Clock::now()) {
      changed_.wait_until(lock, due);  // or until another snapshot arrives
      continue;
    }
    busy_session_ = oldest->first.first;
    const Receiver receiver = receivers_.at(busy_session_);
    const FieldSnapshot snapshot = std::move(oldest->second.snapshot);
    waiting_.erase(oldest);
    lock.unlock();
    MakeMesh(receiver, snapshot);
    lock.lock();
    busy_session_ = 0;
    changed_.notify_all();
  }
}

}  // namespace romap::session
