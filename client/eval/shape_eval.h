#pragma once

#include <optional>

#include "client/eval/points.h"

namespace romap::eval {

// How well a predicted surface bounds a solid, compared with the whole true surface, undersides included.
struct ShapeFigures {
  double accuracy_closed_cm = 0;  // mean distance from predicted points to the nearest true one
  // The share of the predicted points that are more than 1 cm inside the true surface: hollows. nullopt without true
  // normals.
  std::optional<double> hollow_percent;
  // The mean angle between the predicted normal and that of the nearest true point, over the predicted points that are
  // less than 1 cm from the truth. nullopt without normals, or if there is no such point.
  std::optional<double> normal_error_deg;
};

// Both in meters and in the same frame; neither may be empty.
ShapeFigures MeasureShape(const OrientedPoints& truth, const OrientedPoints& predicted);

}  // namespace romap::eval
