// Compares the resources of the compiled kernels on each architecture with the limits, and prints them.
#include <cxxabi.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/cuda/resource_limits.h"
#include "server/nerf/model/field_model.h"
#include "tests/support/subprocess.h"

namespace romap::nerf::cuda::resources_test {

struct KernelUsage {
  std::string kernel;  // without namespaces and parameters
  int registers = -1, spill_bytes = -1, stack_bytes = -1, shared_bytes = 0;
};

std::string ShortName(const std::string& mangled) {
  const std::unique_ptr<char, void (*)(void*)> demangled(
      abi::__cxa_demangle(mangled.c_str(), nullptr, nullptr, nullptr), std::free);
  std::string name = demangled ? demangled.get() : mangled;
  name = std::regex_replace(name, std::regex(R"(romap::nerf::cuda::|\(anonymous namespace\)::|^void )"), "");
  return name.substr(0, name.find('('));
}

// Parses the report of `ptxas -v`.
std::vector<KernelUsage> ParseReport(const std::string& report) {
  std::vector<KernelUsage> all;
  std::istringstream lines(report);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_search(line, match, std::regex("Compiling entry function '([^']+)'"))) {
      all.push_back({.kernel = ShortName(match[1])});
    }
    if (all.empty()) continue;
    if (std::regex_search(
            line, match, std::regex(R"((\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads)"))) {
      all.back().stack_bytes = std::stoi(match[1]);
      all.back().spill_bytes = std::stoi(match[2]) + std::stoi(match[3]);
    }
    if (std::regex_search(line, match, std::regex(R"(Used (\d+) registers)"))) {
      all.back().registers = std::stoi(match[1]);
      if (std::regex_search(line, match, std::regex(R"((\d+) bytes smem)"))) {
        all.back().shared_bytes = std::stoi(match[1]);
      }
    }
  }
  return all;
}

class CudaResourceTest : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Sm, CudaResourceTest, testing::ValuesIn(kArchitectures),
                         [](const auto& info) { return std::to_string(info.param); });

TEST_P(CudaResourceTest, KernelsStayWithinTheirLimits) {
  size_t kernels = 0;
  for (const char* file : {"step_kernel", "optimize_kernels"}) {
    const testing_support::ProcessResult result =
        testing_support::RunProcess({ROMAP_PTXAS, "-v", fmt::format("-arch=sm_{}", GetParam()),
                                     fmt::format("{}/{}.ptx", ROMAP_PTX_DIR, file), "-o", "/dev/null"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    for (const KernelUsage& usage : ParseReport(result.out + result.err)) {
      fmt::print("sm_{:<4} {:<28} {:4} registers {:4} bytes spilled {:4} bytes of stack {:6} bytes of static shared\n",
                 GetParam(), usage.kernel, usage.registers, usage.spill_bytes, usage.stack_bytes, usage.shared_bytes);
      const auto limit = std::ranges::find_if(
          kResourceLimits, [&](const ResourceLimit& l) { return usage.kernel.starts_with(l.kernel); });
      ASSERT_NE(limit, std::end(kResourceLimits)) << usage.kernel << " has no limit";
      EXPECT_GT(usage.registers, 0) << usage.kernel;
      EXPECT_LE(usage.registers, limit->registers) << usage.kernel;
      EXPECT_GE(usage.spill_bytes, 0) << usage.kernel;
      EXPECT_LE(usage.spill_bytes, limit->spill_bytes) << usage.kernel;
      EXPECT_LE(usage.stack_bytes, limit->stack_bytes) << usage.kernel;
      EXPECT_EQ(usage.shared_bytes, 0) << usage.kernel << ": shared memory is dynamic";
      ++kernels;
    }
  }
  EXPECT_EQ(kernels, 6u);
}

size_t StepBytes(int levels, int hidden, int max_samples) {
  DeviceField field{};
  NerfConfig config;
  config.levels = levels;
  field.grid = MakeGridLayout(config);
  field.hidden = hidden;
  const size_t bytes = StepSharedBytes(field, {.max_samples = max_samples}, MlpPath::kTensorCores);
  fmt::print("StepKernel<TensorMlp>, {} levels, {} neurons, {} samples a ray: {} bytes of dynamic shared memory\n",
             levels, hidden, max_samples, bytes);
  return bytes;
}

TEST(CudaResources, SharedMemoryStaysWithinItsLimits) {
  EXPECT_LE(StepBytes(8, 32, 16), kFastStepSharedBytes);
  EXPECT_LE(StepBytes(16, 64, 32), kPaperStepSharedBytes);
  for (const int max_samples : {1, 16, kMaxSamplesPerRay}) {
    EXPECT_LE(StepBytes(kMaxLevels, kMaxHidden, max_samples), kMaxStepSharedBytes);
  }
}

// Devices newer than those compiled for need the PTX.
TEST(CudaResources, PtxIsForEveryDeviceSinceComputeCapability8) {
  for (const char* file : {"step_kernel", "optimize_kernels"}) {
    std::ifstream stream(fmt::format("{}/{}.ptx", ROMAP_PTX_DIR, file));
    const std::string ptx{std::istreambuf_iterator<char>(stream), {}};
    EXPECT_NE(ptx.find(".target sm_80"), std::string::npos) << file;
    EXPECT_EQ(ptx.find("wmma.mma.sync") != std::string::npos, std::string(file) == "step_kernel");
    EXPECT_EQ(ptx.find(".f64"), std::string::npos)
        << file << ": the kernels must not use double precision, which is slow on devices";
  }
}

}  // namespace romap::nerf::cuda::resources_test
