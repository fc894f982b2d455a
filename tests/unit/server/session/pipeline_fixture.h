#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "server/session/pipeline.h"
#include "tests/support/streams.h"

namespace romap::session {

// A pipeline whose training pool and mesher have no threads.
class PipelineFixture : public ::testing::Test {
 protected:
  explicit PipelineFixture(const ServerConfig& config = {}) : config_(config) {}

  static SessionOptions Options() {
    SessionOptions options;
    options.camera = testing_support::SmallCamera();
    return options;
  }

  // The acknowledgements since the last call.
  std::vector<FrameAck> ReadAcks() {
    std::vector<FrameAck> acks;
    while (const auto event = outbox_->Next(std::chrono::milliseconds(0))) {
      if (const auto* ack = std::get_if<FrameAck>(&*event)) acks.push_back(*ack);
    }
    return acks;
  }
  Statistics Counters() const {
    Statistics statistics;
    ledger_.FillIn(&statistics);
    return statistics;
  }

  const ServerConfig config_;
  nerf::TrainingPool pool_{config_.nerf, /*workers=*/0};
  Mesher mesher_{config_.mesh, Mesher::Threading::kCaller};
  MapState map_;
  std::shared_ptr<Outbox> outbox_ = map_.Subscribe(Outbox::Acks::kAll, 100);
  DiagnosticLog diagnostics_{"session", &map_};
  FrameLedger ledger_{"session", &map_};
  Pipeline pipeline_{Options(), config_, &pool_, &mesher_, &map_, &ledger_, &diagnostics_, /*on_accepted=*/nullptr};
};

}  // namespace romap::session
