#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/map_events.h"

namespace romap::client {

// The inputs of a resuming stream that may have to be sent again, in the order in which the caller gave them. An input
// is settled, and forgotten, once its acknowledgement was delivered to the caller and the server keeps it: from a
// server with a store, once a Durable event covers it; else at once. A rejected input is settled, too. Not thread-safe.
class UnsettledInputs {
 public:
  using Clock = std::chrono::steady_clock;

  struct Outgoing {
    std::shared_ptr<const SessionInput> input;
    bool resent = false;  // see FrameInput
  };

  static size_t BytesOf(const SessionInput& input);

  void Add(SessionInput input, Clock::time_point now);
  // The next input for the current stream; nullopt if all were taken.
  std::optional<Outgoing> TakeNext();
  // A new stream begins: all inputs are sent again on it. `durable`: the server has a store.
  void BeginStream(bool durable);

  // An acknowledgement of the server. Appends those to `deliver` that the caller has not had yet.
  //
  // An accepted input proves that all inputs of its kind before it on the same stream arrived, because the server
  // acknowledges in order. Their acknowledgements may be missing, because they were sent to the stream before, or
  // because the server dropped them for a slow reader. They are delivered as duplicates, without a pose.
  void Acknowledge(const FrameAck& ack, std::vector<MapEvent>* deliver) { AcknowledgeAny(ack, false, deliver); }
  void Acknowledge(const MasksAck& ack, std::vector<MapEvent>* deliver) { AcknowledgeAny(ack, true, deliver); }
  void Cover(const Durable& durable);

  // Removes the oldest frame that was never sent and returns its id. nullopt: there is none.
  std::optional<uint64_t> DropOldestUnsentFrame();
  // Removes the frames that were never sent and were added before `time`; their ids.
  std::vector<uint64_t> DropUnsentFrames(Clock::time_point time);
  void Clear();

  size_t size() const { return items_.size(); }
  size_t bytes() const { return bytes_; }
  // Not yet taken for the current stream.
  size_t Waiting() const;
  bool HasWaiting() const { return items_.lower_bound(next_) != items_.end(); }
  // Whether the server has answered every input on the current stream, so that it has all of them.
  bool AllAnswered() const;
  // Inputs whose acknowledgement the caller has not had yet.
  size_t Unacknowledged() const;
  // Of the frames.
  std::optional<uint64_t> NewestFrameId() const;

 private:
  struct Item {
    std::shared_ptr<const SessionInput> input;
    bool is_masks = false;
    uint64_t frame_id = 0;
    size_t bytes = 0;
    Clock::time_point added;
    bool sent = false;            // on any stream
    bool waited = false;          // while there was no stream
    bool sent_on_stream = false;  // on the current one
    bool acked = false;           // the caller has had its acknowledgement
    bool answered = false;        // the server has acknowledged it on the current stream
    bool covered = false;         // by a Durable event
  };
  using Items = std::map<uint64_t, Item>;  // by sequence number

  template <class Ack>
  void AcknowledgeAny(const Ack& ack, bool is_masks, std::vector<MapEvent>* deliver);
  template <class Ack>
  void AcknowledgeBefore(uint64_t sequence, bool is_masks, std::vector<MapEvent>* deliver);
  Items::iterator Find(bool is_masks, uint64_t frame_id);
  bool IsSettled(const Item& item) const { return item.acked && (!durable_ || item.covered); }
  Items::iterator Erase(Items::iterator item);

  Items items_;
  bool is_first_ = true;  // no stream has begun
  uint64_t added_ = 0;    // the next sequence number
  uint64_t next_ = 0;     // sequence number from which on the inputs were not taken for the current stream
  size_t bytes_ = 0;
  bool durable_ = false;
};

}  // namespace romap::client
