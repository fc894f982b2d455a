#include "server/objects/fit_schedule.h"

#include <algorithm>
#include <utility>

namespace romap::objects {
namespace {

double Need(const FitRequest& request) {
  constexpr double kUnconfirmedWeight = 4;
  const double news = static_cast<double>(std::max(1, request.news)) / std::max(1, request.silhouettes);
  const double waiting = static_cast<double>(request.waiting_frames) + 1;
  return (request.confirmed ? 1 : kUnconfirmedWeight) * news * waiting;
}

}  // namespace

bool IsWorthAFit(const FitRequest& request) {
  constexpr int kKnownPerNews = 10;
  return !request.confirmed || kKnownPerNews * request.news >= request.silhouettes;
}

std::vector<LandmarkKey> OrderByNeed(const std::vector<FitRequest>& requests) {
  std::vector<std::pair<double, LandmarkKey>> by_need;
  for (const FitRequest& request : requests) by_need.emplace_back(-Need(request), request.key);
  std::sort(by_need.begin(), by_need.end());
  std::vector<LandmarkKey> keys;
  for (const auto& [need, key] : by_need) keys.push_back(key);
  return keys;
}

}  // namespace romap::objects
