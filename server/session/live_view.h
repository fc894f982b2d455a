#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <mutex>

#include "common/mapping_service.h"
#include "common/stage_messages.h"

namespace romap::session {

// What viewers may see of a running session besides its map: the newest image and the points of the sparse map. The
// session only replaces references here; the viewers' threads do the work. Thread-safe.
class LiveView {
 public:
  void SetImage(std::shared_ptr<const Frame> frame);
  // `points.revision` is overwritten.
  void SetPoints(SparsePoints points);

  // As MappingService::NewestImage().
  absl::StatusOr<CameraImage> Image(int max_side_px) const;
  SparsePoints Points() const;

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Frame> frame_;                                             // null before the first one
  std::shared_ptr<const SparsePoints> points_ = std::make_shared<SparsePoints>();  // never null
};

}  // namespace romap::session
