// The measurements of cuda_engine_check, run on the device emulated on the host.
#include "tests/unit/server/nerf/cuda/runtime_table.h"

#include "tests/unit/server/nerf/cuda/device_test.h"

namespace romap::nerf::cuda::runtime_table_test {

using RuntimeTableTest = DeviceTest;

TEST_F(RuntimeTableTest, EveryPartIsMeasured) {
  NerfConfig config;
  config.levels = 2;
  config.log2_table_entries = 8;
  config.hidden_width = 16;
  config.rays_per_step = 64;
  const auto table = MeasureRuntime(config, "small", 1, 8);
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_GT(table->samples, 64 * config.min_samples_per_ray / 2);
  EXPECT_LE(table->samples, 64 * config.max_samples_per_ray);
  for (const double ms :
       {table->ray_upload_ms, table->gradients_ms, table->optimize_ms, table->iteration_ms, table->evaluate_ms}) {
    EXPECT_GT(ms, 0);
  }
  const std::string text = Markdown(DeviceName(), {*table});
  EXPECT_NE(text.find("Runtime on this host"), std::string::npos) << text;
  EXPECT_NE(text.find("| small |"), std::string::npos) << text;
}

}  // namespace romap::nerf::cuda::runtime_table_test
