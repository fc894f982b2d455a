#include "client/importers/frame_times.h"

#include <algorithm>
#include <cmath>

#include "client/files/associate.h"

namespace romap::importers {
namespace {
constexpr double kDefaultRate_hz = 30;
}  // namespace

void SetTimesByRate(const ReadOptions& options, RecordingContents* contents) {
  contents->camera.fps = options.fps > 0 ? options.fps : kDefaultRate_hz;
  for (size_t k = 0; k < contents->frames.size(); ++k) {
    contents->frames[k].timestamp_ns = std::llround(1e9 * static_cast<double>(k) / contents->camera.fps);
  }
}

void SetRateByTimes(RecordingContents* contents) {
  std::vector<int64_t> times_ns;
  for (const RecordedFrame& frame : contents->frames) times_ns.push_back(frame.timestamp_ns);
  const int64_t step_ns = files::MedianStep_ns(times_ns);
  contents->camera.fps = step_ns > 0 ? 1e9 / static_cast<double>(step_ns) : kDefaultRate_hz;
}

void SortByTime(RecordingContents* contents) {
  std::vector<RecordedFrame>& frames = contents->frames;
  std::ranges::stable_sort(frames, {}, &RecordedFrame::timestamp_ns);
  const auto is_same_time = [](const RecordedFrame& a, const RecordedFrame& b) {
    return a.timestamp_ns == b.timestamp_ns;
  };
  frames.erase(std::unique(frames.begin(), frames.end(), is_same_time), frames.end());
}

}  // namespace romap::importers
