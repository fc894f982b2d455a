#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "common/mapping_service.h"
#include "common/status.h"
#include "tests/contract/backends.h"
#include "tests/support/streams.h"

namespace romap::contract {

using testing_support::Eventually;
using testing_support::MakeFrame;
using testing_support::NextOf;
using testing_support::Only;
using testing_support::ReadToEnd;
using testing_support::SmallCamera;

class MappingServiceContract : public ::testing::TestWithParam<Backend> {
 protected:
  MappingService& service() { return backend_.service(); }

  std::string NewSession(const std::string& name = "") {
    SessionOptions options;
    options.name = name;
    options.camera = testing_support::SmallCamera();
    const auto info = service().CreateSession(options);
    EXPECT_TRUE(info.ok()) << Message(info.status());
    return info.ok() ? info->id : "";
  }

  std::unique_ptr<MapStream> Open(const std::string& session_id) {
    auto stream = service().OpenMap(session_id);
    EXPECT_TRUE(stream.ok()) << Message(stream.status());
    return stream.ok() ? *std::move(stream) : nullptr;
  }

  // Opens a stream while the previous stream of the session may still be closing.
  std::unique_ptr<MapStream> Reopen(const std::string& session_id) {
    std::unique_ptr<MapStream> reopened;
    EXPECT_TRUE(testing_support::Eventually([&] {
      auto stream = service().OpenMap(session_id);
      if (stream.ok()) reopened = *std::move(stream);
      return stream.ok();
    }));
    return reopened;
  }

  RunningBackend backend_{GetParam()};
};

}  // namespace romap::contract
