#include "server/slam/places/descriptor_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

namespace romap::slam::descriptor_tree_test {

constexpr int kAllLeaves = std::numeric_limits<int>::max();

class DescriptorTreeTest : public ::testing::Test {
 protected:
  Descriptor Draw() {
    Descriptor descriptor;
    for (uint64_t& word : descriptor) word = random_();
    return descriptor;
  }

  std::multiset<uint32_t> OwnersIn(const DescriptorTree& tree, const Descriptor& descriptor, int max_leaves) {
    tree.FindLeaves(descriptor, max_leaves, search_);
    std::multiset<uint32_t> owners;
    for (const uint32_t leaf : search_.leaves) {
      for (const auto& entry : tree.entries(leaf)) owners.insert(entry.owner);
    }
    return owners;
  }

  std::mt19937_64 random_{3};
  DescriptorTree::Search search_;
};

TEST_F(DescriptorTreeTest, FindsEveryEntryInItsNearestLeaf) {
  DescriptorTree tree(1);
  std::vector<Descriptor> descriptors;
  for (uint32_t i = 0; i < 5000; ++i) {
    descriptors.push_back(Draw());
    tree.Insert({descriptors.back(), i});
  }
  EXPECT_EQ(OwnersIn(tree, descriptors[0], kAllLeaves).size(), 5000u);
  EXPECT_GT(search_.leaves.size(), 20u);
  for (uint32_t i = 0; i < 5000; i += 97) EXPECT_TRUE(OwnersIn(tree, descriptors[i], 1).contains(i)) << i;
}

TEST_F(DescriptorTreeTest, SearchingMoreLeavesFindsMoreNeighbors) {
  DescriptorTree tree(1);
  std::vector<Descriptor> descriptors;
  for (uint32_t i = 0; i < 5000; ++i) {
    descriptors.push_back(Draw());
    tree.Insert({descriptors.back(), i});
  }
  std::bernoulli_distribution flipped(0.1);
  int found_in_one = 0;
  int found_in_three = 0;
  for (uint32_t i = 0; i < 500; ++i) {
    Descriptor noisy = descriptors[i];
    for (uint64_t& word : noisy) {
      for (int bit = 0; bit < 64; ++bit) word ^= uint64_t{flipped(random_)} << bit;
    }
    found_in_one += OwnersIn(tree, noisy, 1).contains(i);
    found_in_three += OwnersIn(tree, noisy, 3).contains(i);
  }
  EXPECT_GT(found_in_one, 200);  // a random leaf would contain 20
  EXPECT_GT(found_in_three, found_in_one + 20);
}

TEST_F(DescriptorTreeTest, HandlesEqualDescriptors) {
  DescriptorTree tree(1);
  const Descriptor same = Draw();
  for (uint32_t i = 0; i < 3000; ++i) tree.Insert({same, i});
  EXPECT_EQ(OwnersIn(tree, same, 1).size(), 3000u);
}

TEST_F(DescriptorTreeTest, RemovesEntriesByOwner) {
  DescriptorTree tree(1);
  const Descriptor query = Draw();
  for (uint32_t i = 0; i < 2000; ++i) tree.Insert({Draw(), i % 4});
  tree.RemoveOwners(std::vector<uint8_t>{0, 1, 0, 1});
  const auto owners = OwnersIn(tree, query, kAllLeaves);
  EXPECT_EQ(owners.count(0), 500u);
  EXPECT_EQ(owners.count(1), 0u);
  EXPECT_EQ(owners.count(2), 500u);
  EXPECT_EQ(owners.count(3), 0u);
}

}  // namespace romap::slam::descriptor_tree_test
