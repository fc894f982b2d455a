#include "server/objects/fit_schedule.h"

#include <algorithm>
#include <utility>

namespace romap::objects {
namespace {

double Urgency(const FitRequest& request) {
  constexpr double kUnconfirmedWeight = 4;  // their cuboid decides whether they are confirmed
  const double changed_share = static_cast<double>(std::max(1, request.changed)) / std::max(1, request.silhouettes);
  const double waiting = static_cast<double>(request.waiting_frames) + 1;
  return (request.confirmed ? 1 : kUnconfirmedWeight) * changed_share * waiting;
}

}  // namespace

bool IsDueForFit(const FitRequest& request) {
  constexpr int kSilhouettesPerChanged = 10;  // at least one in ten must have changed
  return !request.confirmed || kSilhouettesPerChanged * request.changed >= request.silhouettes;
}

std::vector<LandmarkKey> OrderByUrgency(const std::vector<FitRequest>& requests) {
  std::vector<std::pair<double, LandmarkKey>> by_urgency;
  for (const FitRequest& request : requests) by_urgency.emplace_back(-Urgency(request), request.key);
  std::sort(by_urgency.begin(), by_urgency.end());
  std::vector<LandmarkKey> keys;
  for (const auto& [urgency, key] : by_urgency) keys.push_back(key);
  return keys;
}

}  // namespace romap::objects
