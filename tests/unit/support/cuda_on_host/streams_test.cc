// Tests of streams, which execute as late as possible, of graphs, and of failing devices.
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/cuda_on_host/cuda_on_host.h"

namespace romap::streams_test {

__global__ void AddOne(int* value, const int* limit) {
  if (*value < *limit) *value += 1;
}

class CudaStreams : public testing::Test {
 protected:
  void SetUp() override {
    cuda_on_host::SetDeviceTraits({});
    ASSERT_EQ(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), cudaSuccess);
    ASSERT_EQ(cudaMalloc(&device_, 2 * sizeof(int)), cudaSuccess);
    const int start[] = {0, 100};
    ASSERT_EQ(cudaMemcpy(device_, start, sizeof(start), cudaMemcpyHostToDevice), cudaSuccess);
  }
  void TearDown() override {
    cuda_on_host::SetDeviceTraits({});
    EXPECT_EQ(cudaFree(device_), cudaSuccess);
    EXPECT_EQ(cudaStreamDestroy(stream_), cudaSuccess);
  }

  void Launch() { ROMAP_LAUNCH(AddOne, dim3(1), dim3(1), 0, stream_, device_, device_ + 1); }
  int Value() const {
    int value = -1;
    EXPECT_EQ(cudaMemcpy(&value, device_, sizeof(value), cudaMemcpyDeviceToHost), cudaSuccess);
    return value;
  }

  cudaStream_t stream_ = nullptr;
  int* device_ = nullptr;
};

TEST_F(CudaStreams, WorkRunsAtTheNextSynchronization) {
  Launch();
  int copied = 77;
  EXPECT_EQ(cudaMemcpyAsync(&copied, device_, sizeof(copied), cudaMemcpyDeviceToHost, stream_), cudaSuccess);
  EXPECT_EQ(Value(), 0);
  EXPECT_EQ(copied, 77);
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaSuccess);
  EXPECT_EQ(Value(), 1);
  EXPECT_EQ(copied, 1);
}

TEST_F(CudaStreams, SourcesOfCopiesAreReadAtSynchronization) {
  int source = 5;
  EXPECT_EQ(cudaMemcpyAsync(device_, &source, sizeof(source), cudaMemcpyHostToDevice, stream_), cudaSuccess);
  source = 6;  // a mistake of the caller that must be visible
  EXPECT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  EXPECT_EQ(Value(), 6);
}

TEST_F(CudaStreams, EventsWaitForEarlierWork) {
  cudaEvent_t event = nullptr;
  ASSERT_EQ(cudaEventCreate(&event), cudaSuccess);
  Launch();
  EXPECT_EQ(cudaEventRecord(event, stream_), cudaSuccess);
  EXPECT_EQ(cudaEventSynchronize(event), cudaSuccess);
  EXPECT_EQ(Value(), 1);
  EXPECT_EQ(cudaEventDestroy(event), cudaSuccess);
}

TEST_F(CudaStreams, AnEventMayBeDestroyedBeforeItsRecordRuns) {
  cudaEvent_t event = nullptr;
  ASSERT_EQ(cudaEventCreate(&event), cudaSuccess);
  EXPECT_EQ(cudaEventRecord(event, stream_), cudaSuccess);
  EXPECT_EQ(cudaEventDestroy(event), cudaSuccess);
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaSuccess);
}

TEST_F(CudaStreams, GraphsReplayCapturedWork) {
  ASSERT_EQ(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal), cudaSuccess);
  Launch();
  Launch();
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaErrorStreamCaptureUnsupported);
  cudaGraph_t graph = nullptr;
  cudaGraphExec_t executable = nullptr;
  ASSERT_EQ(cudaStreamEndCapture(stream_, &graph), cudaSuccess);
  ASSERT_EQ(cudaGraphInstantiate(&executable, graph), cudaSuccess);
  EXPECT_EQ(cudaGraphDestroy(graph), cudaSuccess);
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaSuccess);
  EXPECT_EQ(Value(), 0);  // captured, not run
  for (int i = 0; i < 3; ++i) EXPECT_EQ(cudaGraphLaunch(executable, stream_), cudaSuccess);
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaSuccess);
  EXPECT_EQ(Value(), 6);
  EXPECT_EQ(cudaGraphExecDestroy(executable), cudaSuccess);
}

TEST_F(CudaStreams, AFaultPersistsUntilTheDeviceIsReset) {
  cuda_on_host::SetDeviceTraits({.kernels_before_fault = 1});
  Launch();
  Launch();
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaErrorLaunchFailure);
  EXPECT_EQ(cudaStreamSynchronize(stream_), cudaErrorLaunchFailure);
  void* more = nullptr;
  EXPECT_EQ(cudaMalloc(&more, 10), cudaErrorLaunchFailure);
  int value = 0;
  EXPECT_EQ(cudaMemcpy(&value, device_, sizeof(value), cudaMemcpyDeviceToHost), cudaErrorLaunchFailure);
  cuda_on_host::SetDeviceTraits({});
  EXPECT_EQ(Value(), 1);  // the effect of the first kernel
}

}  // namespace romap::streams_test
