#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "tests/support/cuda_on_host/block_runner.h"
#include "tests/support/cuda_on_host/runtime_api.h"

using Operation = std::function<cudaError_t()>;

struct CudaGraphOnHost {
  std::vector<Operation> operations;
};
struct CudaStreamOnHost {
  std::mutex mutex;  // held while operations run, to keep their order
  std::deque<Operation> waiting;
  std::unique_ptr<CudaGraphOnHost> capture;
};
struct CudaEventOnHost {
  using Time = std::chrono::steady_clock::time_point;
  std::shared_ptr<Time> at = std::make_shared<Time>();  // shared with waiting records, which may outlive the event
  cudaStream_t stream = nullptr;                        // where it was recorded
};

namespace romap::cuda_on_host {
namespace {

struct Streams {
  std::mutex mutex;
  std::set<cudaStream_t> all;
};

Streams& TheStreams() {
  static Streams streams;
  return streams;
}

cudaError_t Finish(cudaStream_t stream) {
  if (stream == nullptr) return DeviceFault();
  std::lock_guard lock(stream->mutex);
  if (stream->capture) return cudaErrorStreamCaptureUnsupported;
  cudaError_t first = cudaSuccess;
  while (!stream->waiting.empty()) {
    const Operation operation = std::move(stream->waiting.front());
    stream->waiting.pop_front();
    const cudaError_t error = operation();
    if (first == cudaSuccess) first = error;
  }
  return first == cudaSuccess ? DeviceFault() : first;
}

}  // namespace

cudaError_t Enqueue(cudaStream_t stream, Operation operation) {
  if (stream == nullptr) return operation();
  std::lock_guard lock(stream->mutex);
  if (stream->capture) {
    stream->capture->operations.push_back(std::move(operation));
  } else {
    stream->waiting.push_back(std::move(operation));
  }
  return DeviceFault();
}

cudaError_t FinishAllStreams() {
  std::set<cudaStream_t> all;
  {
    std::lock_guard lock(TheStreams().mutex);
    all = TheStreams().all;
  }
  cudaError_t first = DeviceFault();
  for (const cudaStream_t stream : all) {
    const cudaError_t error = Finish(stream);
    if (first == cudaSuccess) first = error;
  }
  return first;
}

}  // namespace romap::cuda_on_host

using romap::cuda_on_host::DeviceFault;
using romap::cuda_on_host::Enqueue;
using romap::cuda_on_host::Finish;
using romap::cuda_on_host::TheStreams;

cudaError_t cudaDeviceSynchronize() {
  const cudaError_t error = romap::cuda_on_host::FinishAllStreams();
  return error == cudaSuccess ? cudaPeekAtLastError() : error;
}

cudaError_t cudaMemsetAsync(void* p, int value, size_t bytes, cudaStream_t stream) {
  return Enqueue(stream, [=] { return cudaMemset(p, value, bytes); });
}

cudaError_t cudaMemcpyAsync(void* to, const void* from, size_t bytes, cudaMemcpyKind kind, cudaStream_t stream) {
  return Enqueue(stream, [=] { return cudaMemcpy(to, from, bytes, kind); });
}

cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned) {
  *stream = nullptr;
  if (const cudaError_t error = DeviceFault()) return error;
  *stream = new CudaStreamOnHost;
  std::lock_guard lock(TheStreams().mutex);
  TheStreams().all.insert(*stream);
  return cudaSuccess;
}

cudaError_t cudaStreamDestroy(cudaStream_t stream) {
  const cudaError_t error = Finish(stream);
  {
    std::lock_guard lock(TheStreams().mutex);
    TheStreams().all.erase(stream);
  }
  delete stream;
  return error;
}

cudaError_t cudaStreamSynchronize(cudaStream_t stream) { return Finish(stream); }

cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode) {
  if (const cudaError_t error = DeviceFault()) return error;
  if (stream == nullptr) return cudaErrorStreamCaptureUnsupported;
  std::lock_guard lock(stream->mutex);
  if (stream->capture) return cudaErrorStreamCaptureUnsupported;
  stream->capture = std::make_unique<CudaGraphOnHost>();
  return cudaSuccess;
}

cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph) {
  std::lock_guard lock(stream->mutex);
  *graph = stream->capture.release();
  return *graph == nullptr ? cudaErrorStreamCaptureUnsupported : DeviceFault();
}

cudaError_t cudaGraphInstantiate(cudaGraphExec_t* executable, cudaGraph_t graph, unsigned long long) {
  *executable = new CudaGraphOnHost(*graph);
  return DeviceFault();
}

cudaError_t cudaGraphLaunch(cudaGraphExec_t executable, cudaStream_t stream) {
  for (const Operation& operation : executable->operations) {
    if (const cudaError_t error = Enqueue(stream, operation)) return error;
  }
  return cudaSuccess;
}

cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
  delete graph;
  return DeviceFault();
}

cudaError_t cudaGraphExecDestroy(cudaGraphExec_t executable) {
  delete executable;
  return DeviceFault();
}

cudaError_t cudaEventCreate(cudaEvent_t* event) {
  *event = new CudaEventOnHost;
  return DeviceFault();
}

cudaError_t cudaEventDestroy(cudaEvent_t event) {
  delete event;
  return DeviceFault();
}

cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t stream) {
  event->stream = stream;
  return Enqueue(stream, [at = event->at] {
    *at = std::chrono::steady_clock::now();
    return cudaSuccess;
  });
}

cudaError_t cudaEventSynchronize(cudaEvent_t event) { return Finish(event->stream); }

cudaError_t cudaEventElapsedTime(float* milliseconds, cudaEvent_t start, cudaEvent_t end) {
  *milliseconds = std::chrono::duration<float, std::milli>(*end->at - *start->at).count();
  return DeviceFault();
}
