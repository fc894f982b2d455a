#include "client/synth/solids.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <utility>

#include "client/synth/bvh.h"

namespace romap::synth::solids_test {

class EverySolidTest : public ::testing::TestWithParam<SolidKind> {
 protected:
  static Solid Make(uint64_t seed) {
    Random random(seed);
    Solid solid = GetParam().make(random);
    Settle(solid);
    return solid;
  }
};

INSTANTIATE_TEST_SUITE_P(Kinds, EverySolidTest, ::testing::ValuesIn(SolidKinds().begin(), SolidKinds().end()),
                         [](const auto& info) { return std::string(info.param.name); });

double SignedVolume(const Mesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume +=
        mesh.vertices[a].cast<double>().dot(mesh.vertices[b].cast<double>().cross(mesh.vertices[c].cast<double>())) / 6;
  }
  return volume;
}

TEST_P(EverySolidTest, HasClosedPartsThatFaceOutward) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    for (const SolidPart& part : Make(seed).parts) {
      // Each directed edge and its reverse occur once: closed, two triangles per edge, consistent orientation.
      std::set<std::pair<uint32_t, uint32_t>> edges;
      for (const auto& triangle : part.mesh.triangles) {
        for (int k = 0; k < 3; ++k) {
          ASSERT_TRUE(edges.emplace(triangle[k], triangle[(k + 1) % 3]).second) << "an edge has three triangles";
        }
      }
      for (const auto& [from, to] : edges) ASSERT_TRUE(edges.contains({to, from})) << "an edge is open";
      EXPECT_GT(SignedVolume(part.mesh), 0);
    }
  }
}

TEST_P(EverySolidTest, StandsAtZeroAndMeasuresFiveToThirtyCentimeters) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const Solid solid = Make(seed);
    const Eigen::AlignedBox3f bounds = Bounds(solid);
    EXPECT_NEAR(bounds.min().z(), 0, 1e-6);
    EXPECT_NEAR(bounds.center().x(), 0, 1e-6);
    EXPECT_NEAR(bounds.center().y(), 0, 1e-6);
    EXPECT_GE(bounds.sizes().maxCoeff(), 0.05F);
    EXPECT_LE(bounds.sizes().maxCoeff(), 0.31F);
    EXPECT_GE(FootprintRadius(solid), 0.5F * bounds.sizes().head<2>().maxCoeff() - 1e-5F);
    EXPECT_FALSE(solid.class_name.empty());
  }
}

TEST_P(EverySolidTest, IsConnected) {
  // Every part overlaps or touches the bounding box of another one.
  const Solid solid = Make(4);
  std::vector<Eigen::AlignedBox3f> boxes;
  for (const SolidPart& part : solid.parts) {
    Eigen::AlignedBox3f& box = boxes.emplace_back();
    for (const Point& p : part.mesh.vertices) box.extend(p);
    box.min() -= Point::Constant(1e-4F);
    box.max() += Point::Constant(1e-4F);
  }
  std::set<size_t> reached = {0};
  for (bool grown = true; grown;) {
    grown = false;
    for (size_t i = 0; i < boxes.size(); ++i) {
      for (const size_t j : reached) {
        if (reached.contains(i) || !boxes[i].intersects(boxes[j])) continue;
        reached.insert(i);
        grown = true;
        break;
      }
    }
  }
  EXPECT_EQ(reached.size(), boxes.size());
}

TEST_P(EverySolidTest, IsDeterminedByTheSeed) {
  const Solid a = Make(7);
  const Solid b = Make(7);
  const Solid other = Make(8);
  ASSERT_EQ(a.parts.size(), b.parts.size());
  EXPECT_EQ(a.parts[0].mesh.vertices, b.parts[0].mesh.vertices);
  EXPECT_NE(a.parts[0].mesh.vertices, other.parts[0].mesh.vertices);
}

TEST(SolidKindsTest, HaveUniqueNames) {
  std::set<std::string> names;
  for (const SolidKind& kind : SolidKinds()) EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
  EXPECT_GE(names.size(), 16U) << "at least the maximal number of objects";
}

TEST(BowlTest, IsHollow) {
  Random random(3);
  Solid bowl = MakeBowl(random);
  Settle(bowl);
  const Bvh inside(bowl.parts[0].mesh.vertices, bowl.parts[0].mesh.triangles);
  const Eigen::AlignedBox3f bounds = Bounds(bowl);
  EXPECT_FALSE(inside.Contains(Point(0, 0, 0.6F * bounds.max().z())));
  EXPECT_TRUE(inside.Contains(Point(0.001F, 0.002F, 0.004F))) << "the foot is solid";
  EXPECT_FALSE(inside.Contains(Point(0, 0, 2 * bounds.max().z())));
}

}  // namespace romap::synth::solids_test
