// Conversions of random messages return INVALID_ARGUMENT or a value that keeps the documented guarantees.

#include <google/protobuf/stubs/logging.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/frame.h"
#include "common/wire/sessions.h"

namespace romap::wire::random_messages_test {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Fills a message of any type with random values; each field is absent, ordinary, or extreme.
class RandomMessages {
 public:
  explicit RandomMessages(uint64_t seed) : random_(seed) {}

  void Fill(Message& message) {
    for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
      const FieldDescriptor* field = message.GetDescriptor()->field(i);
      if (Chance(0.15)) continue;
      if (!field->is_repeated()) {
        Set(message, field);
        continue;
      }
      for (int n = Pick(0, 5); n > 0; --n) Add(message, field);
    }
  }

 private:
  int Pick(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
  bool Chance(double p) { return std::bernoulli_distribution(p)(random_); }
  double Number() {
    constexpr double kExtremes[] = {0,     -1,  std::numeric_limits<double>::quiet_NaN(),
                                    1e300, 0.5, std::numeric_limits<double>::infinity()};
    return Chance(0.8) ? 1.0 : kExtremes[Pick(0, 5)];
  }
  uint64_t Whole() {
    constexpr uint64_t kExtremes[] = {0, 1, 65535, 65536, 0x7fffffff, 0xffffffff, ~0ull};
    return Chance(0.7) ? static_cast<uint64_t>(Pick(1, 100)) : kExtremes[Pick(0, 6)];
  }
  std::string Bytes() { return std::string(static_cast<size_t>(Pick(0, 9)), 'x'); }

  void Set(Message& message, const FieldDescriptor* field) {
    const auto& access = *message.GetReflection();
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return access.SetDouble(&message, field, Number());
      case FieldDescriptor::CPPTYPE_UINT32:
        return access.SetUInt32(&message, field, static_cast<uint32_t>(Whole()));
      case FieldDescriptor::CPPTYPE_UINT64:
        return access.SetUInt64(&message, field, Whole());
      case FieldDescriptor::CPPTYPE_INT64:
        return access.SetInt64(&message, field, static_cast<int64_t>(Whole()));
      case FieldDescriptor::CPPTYPE_BOOL:
        return access.SetBool(&message, field, Chance(0.5));
      case FieldDescriptor::CPPTYPE_ENUM:
        return access.SetEnumValue(&message, field, Pick(-1, 6));
      case FieldDescriptor::CPPTYPE_STRING:
        return access.SetString(&message, field, Bytes());
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return Fill(*access.MutableMessage(&message, field));
      default:
        FAIL() << "field type is not supported by this test: " << field->full_name();
    }
  }

  void Add(Message& message, const FieldDescriptor* field) {
    const auto& access = *message.GetReflection();
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return access.AddDouble(&message, field, Number());
      case FieldDescriptor::CPPTYPE_UINT32:
        return access.AddUInt32(&message, field, static_cast<uint32_t>(Whole()));
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return Fill(*access.AddMessage(&message, field));
      default:
        FAIL() << "field type is not supported by this test: " << field->full_name();
    }
  }

  std::mt19937_64 random_;
};

constexpr int kRounds = 20'000;

void ExpectInvalidArgument(const absl::Status& status) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(romap::Message(status).find(':'), std::string::npos)
      << "does not name the field: " << romap::Message(status);
}

void ExpectValid(const std::vector<Instance>& instances) {
  for (const Instance& instance : instances) {
    EXPECT_TRUE(instance.label >= 1 && instance.label <= 65535);
    EXPECT_TRUE(instance.score >= 0 && instance.score <= 1);
    EXPECT_FALSE(instance.class_name.empty());
  }
}

TEST(WireRandomMessages, FramesAreValidOrRejected) {
  RandomMessages random(1);
  int valid = 0;
  for (int i = 0; i < kRounds; ++i) {
    v1::Frame proto;
    random.Fill(proto);
    const auto frame = FromProto(std::move(proto));
    if (!frame.ok()) {
      ExpectInvalidArgument(frame.status());
      continue;
    }
    ++valid;
    EXPECT_FALSE(frame->image.empty());
    EXPECT_TRUE(!frame->T_world_camera || frame->T_world_camera->IsFinite());
    EXPECT_TRUE(!frame->gravity_camera || (frame->gravity_camera->allFinite() && frame->gravity_camera->norm() > 0));
    EXPECT_TRUE(frame->depth_encoding == DepthEncoding::kNone || frame->depth_scale_mu > 0);
    ExpectValid(frame->instances);
  }
  EXPECT_GT(valid, 0) << "every message was rejected, so nothing was tested";
}

TEST(WireRandomMessages, LateMasksAreValidOrRejected) {
  RandomMessages random(6);
  int valid = 0;
  for (int i = 0; i < kRounds; ++i) {
    v1::LateMasks proto;
    random.Fill(proto);
    const auto masks = FromProto(std::move(proto));
    if (!masks.ok()) {
      ExpectInvalidArgument(masks.status());
      continue;
    }
    ++valid;
    EXPECT_NE(masks->mask_encoding, MaskEncoding::kNone);
    EXPECT_TRUE(masks->label_png.empty() != masks->label_runs.empty());
    ExpectValid(masks->instances);
  }
  EXPECT_GT(valid, 0) << "every message was rejected, so nothing was tested";
}

TEST(WireRandomMessages, EventsAreValidOrRejected) {
  RandomMessages random(2);
  int valid = 0;
  for (int i = 0; i < kRounds; ++i) {
    v1::MapEvent proto;
    random.Fill(proto);
    const auto event = FromProto(std::move(proto), "event");
    if (!event.ok()) {
      ExpectInvalidArgument(event.status());
      continue;
    }
    ++valid;
    if (const auto* object = std::get_if<ObjectUpdate>(&*event)) {
      EXPECT_TRUE(object->cuboid.T_world_object.IsFinite());
      EXPECT_TRUE(object->cuboid.half_extents.allFinite());
    }
  }
  EXPECT_GT(valid, 0);
}

TEST(WireRandomMessages, SessionsAndExportsAreValidOrRejected) {
  RandomMessages random(3);
  int valid = 0;
  for (int i = 0; i < kRounds; ++i) {
    v1::CreateSessionRequest request;
    random.Fill(request);
    if (const auto options = FromProto(request); !options.ok()) ExpectInvalidArgument(options.status());
    v1::SessionInfo info;
    random.Fill(info);
    if (const auto got = FromProto(info, "session"); !got.ok()) ExpectInvalidArgument(got.status());
    SnapshotAssembler assembler;
    for (int part = 0; part < 3; ++part) {
      v1::ExportMapResponse response;
      random.Fill(response);
      if (const absl::Status added = assembler.Add(std::move(response)); !added.ok()) ExpectInvalidArgument(added);
    }
    if (const auto map = assembler.Take(); map.ok()) {
      ++valid;
      EXPECT_EQ(map->trajectory.size(), map->timestamps_ns.size());
    } else {
      ExpectInvalidArgument(map.status());
    }
  }
  EXPECT_GT(valid, 0);
}

TEST(WireRandomMessages, CorruptedBytesAreValidOrRejected) {
  const google::protobuf::LogSilencer no_utf8_warnings;
  RandomMessages random(4);
  std::mt19937_64 noise(5);
  int parsed = 0;
  for (int i = 0; i < kRounds; ++i) {
    v1::Frame proto;
    random.Fill(proto);
    std::string bytes = proto.SerializeAsString();
    for (int flips = 0; flips < 3 && !bytes.empty(); ++flips) bytes[noise() % bytes.size()] ^= 1 << (noise() % 8);
    v1::Frame corrupted;
    if (!corrupted.ParseFromString(bytes)) continue;
    ++parsed;
    if (const auto frame = FromProto(std::move(corrupted)); !frame.ok()) ExpectInvalidArgument(frame.status());
  }
  EXPECT_GT(parsed, 0);
}

}  // namespace romap::wire::random_messages_test
