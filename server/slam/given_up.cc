#include "server/slam/given_up.h"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "common/angles.h"

namespace romap::slam {
namespace {

// Objects may stand on a slanted surface. Other conventions differ by 90 degrees, the axes of a first camera by the
// tilt of that camera.
constexpr double kMinContradiction_rad = 25 * kRadPerDeg;
constexpr double kMaxAxisError_rad = 10 * kRadPerDeg;

// "x" to "-z", as the option --up of the client names it. nullopt: no axis is near.
std::optional<std::string> NearestAxis(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  const double cosine = direction.cwiseAbs().maxCoeff(&axis);
  if (cosine < std::cos(kMaxAxisError_rad)) return std::nullopt;
  return fmt::format("{}{}", direction[axis] < 0 ? "-" : "", "xyz"[axis]);
}

}  // namespace

std::optional<Diagnostic> CheckGivenUp(const WorldUp& up_of_images, const Eigen::Vector3d& given_up_world) {
  if (!up_of_images.is_known() || !up_of_images.rests_on_support()) return std::nullopt;
  const Eigen::Vector3d& up_world = up_of_images.up_world();
  const double angle_rad = AngleBetween(up_world, given_up_world);
  if (angle_rad < kMinContradiction_rad) return std::nullopt;
  const std::optional<std::string> axis = NearestAxis(up_world);
  return Diagnostic{
      .code = "up_contradicts_images",
      .severity = Severity::kWarning,
      .text =
          fmt::format("the images show up along {} in the world of the given poses, {:.0f} degrees from the "
                      "direction that is taken as up, so cuboids are tilted",
                      axis ? *axis : fmt::format("({:.2f}, {:.2f}, {:.2f})", up_world.x(), up_world.y(), up_world.z()),
                      angle_rad * kDegPerRad),
      .advice = "run with --up " + axis.value_or("auto")};
}

}  // namespace romap::slam
