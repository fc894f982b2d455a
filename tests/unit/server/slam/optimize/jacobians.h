#pragma once

// Checks analytic Jacobians of Ceres costs against finite differences.

#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace romap::slam {

// Compares all Jacobians of `cost` at `parameters` with central differences, to 1e-6 of the largest entry of each.
// Calls `refresh` whenever the parameters have changed. Restores the parameters.
inline void ExpectJacobiansMatch(const ceres::CostFunction& cost, const std::vector<double*>& parameters,
                                 const std::function<void()>& refresh) {
  constexpr double kStep = 1e-6;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const int residuals = cost.num_residuals();
  const std::vector<int>& sizes = cost.parameter_block_sizes();
  ASSERT_EQ(sizes.size(), parameters.size());
  std::vector<RowMajor> analytic;
  for (const int size : sizes) analytic.push_back(RowMajor::Constant(residuals, size, 1e30));
  std::vector<double*> pointers;
  for (RowMajor& jacobian : analytic) pointers.push_back(jacobian.data());

  refresh();
  Eigen::VectorXd at(residuals), below(residuals), above(residuals);
  ASSERT_TRUE(cost.Evaluate(parameters.data(), at.data(), pointers.data()));
  for (size_t block = 0; block < sizes.size(); ++block) {
    RowMajor numeric(residuals, sizes[block]);
    for (int i = 0; i < sizes[block]; ++i) {
      const double value = parameters[block][i];
      parameters[block][i] = value - kStep;
      refresh();
      ASSERT_TRUE(cost.Evaluate(parameters.data(), below.data(), nullptr));
      parameters[block][i] = value + kStep;
      refresh();
      ASSERT_TRUE(cost.Evaluate(parameters.data(), above.data(), nullptr));
      parameters[block][i] = value;
      numeric.col(i) = (above - below) / (2 * kStep);
    }
    refresh();
    const double size = std::max(1e-9, numeric.cwiseAbs().maxCoeff());
    EXPECT_LT((numeric - analytic[block]).cwiseAbs().maxCoeff(), 1e-6 * size) << "block " << block << "\nanalytic\n"
                                                                              << analytic[block] << "\nnumeric\n"
                                                                              << numeric;
    // Ceres requests only the Jacobians of free blocks.
    std::vector<double*> only_this(sizes.size(), nullptr);
    RowMajor alone(residuals, sizes[block]);
    only_this[block] = alone.data();
    ASSERT_TRUE(cost.Evaluate(parameters.data(), at.data(), only_this.data()));
    EXPECT_EQ(alone, analytic[block]);
  }
}

}  // namespace romap::slam
