#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/object_field.h"

namespace romap::nerf {

// The training of one object of one session.
struct TrainingJob {
  using Clock = std::chrono::steady_clock;

  ObjectId object;
  std::unique_ptr<ObjectField> field;  // created by the first lease; only the holder of the lease may access it
  bool leased = false;
  bool removed = false;
  std::vector<ObjectViews> pending_updates;  // not yet applied to the field
  Clock::time_point last_view_time = Clock::now();

  // State of the field after its last slice.
  int views = 0;
  uint64_t steps = 0;
  uint64_t allowed_steps = 0;  // while more views are expected
  uint64_t planned_steps = 0;  // once no more views are expected
  double loss_decrease = 1;    // relative decrease of the loss per 100 steps; 1 while unknown
  double busy_s = 0;           // total cost of all slices, see TrainStats::BusySeconds
  std::string warning;         // see ObjectField::Warning

  // The last snapshot that was sent.
  uint64_t sent_steps = 0;
  Clock::time_point sent_time = Clock::now();

  // `complete`: no more views are expected.
  uint64_t StepsLeft(bool complete) const {
    const uint64_t goal = complete ? planned_steps : allowed_steps;
    return goal > steps ? goal - steps : 0;
  }
};

}  // namespace romap::nerf
